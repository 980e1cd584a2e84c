#include "server/rpc/write_files.h"

#include "absl/strings/str_cat.h"
#include "core/status_macros.h"
#include "server/jobs/crc32c.h"
#include "server/rpc/error.h"
#include "server/rpc/resource_name.h"

namespace pepeseg {
namespace {

constexpr size_t kMaxChunkBytes = size_t{4} << 20;

absl::Status OutOfOrder(const std::string& what) {
  v1::ErrorDetail detail;
  detail.set_reason("OUT_OF_ORDER");
  detail.set_field("part");
  return WithDetail(absl::InvalidArgumentError(what), detail);
}

// The client's name of the file before what went wrong with it.
absl::Status OfFile(const std::string& path, const absl::Status& status) {
  if (status.ok()) return status;
  v1::ErrorDetail detail;
  detail.set_reason(absl::IsDataLoss(status) ? "BYTES_MISMATCH" : "BAD_FILE");
  detail.set_resource(path);
  return WithDetail(
      absl::Status(status.code(), absl::StrCat(path, ": ", std::string(status.message()))), detail);
}

}  // namespace

Stream::Step WriteFilesStream::Work(bool io_ok) {
  if (!io_ok) message_.Clear();
  absl::Status status = Authorize(message_);
  if (!status.ok()) return End(std::move(status));
  if (!io_ok) {
    if (!in_file_) return End(absl::OkStatus());
    return End(OutOfOrder(absl::StrCat(file_.path, ": the stream ended before its end")));
  }
  status = Take(message_);
  if (!status.ok()) return End(std::move(status));
  return {Next::kIo, absl::OkStatus()};
}

absl::Status WriteFilesStream::Authorize(const v1::WriteFilesRequest& part) {
  if (caller_.has_value() && !part.has_header()) return absl::OkStatus();
  auto caller = context_.authorizer->Authorize(origin_, part);
  if (!caller.ok()) return caller.status();
  caller_ = *std::move(caller);
  if (!part.has_header()) return absl::OkStatus();
  // A line for each upload, not for each of its files; at once, since a stream may be cut off.
  if (named_.header().upload() != part.header().upload()) {
    context_.authorizer->Record(origin_, *caller_, part, absl::OkStatus());
  }
  named_ = part;
  return absl::OkStatus();
}

Stream::Step WriteFilesStream::End(absl::Status status) {
  writer_.reset();  // clears the file away here, not in a reaction
  if (!status.ok() && named_.has_header()) {
    context_.authorizer->Record(origin_, *caller_, named_, status);
  }
  return {Next::kEnd, std::move(status)};
}

absl::Status WriteFilesStream::Take(const v1::WriteFilesRequest& part) {
  if (part.has_header()) {
    if (in_file_) return OutOfOrder(absl::StrCat(file_.path, ": no end before the next header"));
    return BeginFile(part.header());
  }
  if (!in_file_) return OutOfOrder("a chunk, an end or nothing where a header must be");
  if (part.has_chunk()) return OfFile(file_.path, TakeChunk(part.chunk()));
  if (part.has_end()) return OfFile(file_.path, EndFile());
  return OutOfOrder(absl::StrCat(file_.path, ": a message that is no part"));
}

absl::Status WriteFilesStream::BeginFile(const v1::WriteFilesRequest::Header& header) {
  ASSIGN_OR_RETURN(const SceneChild upload,
                   ParseChildName(header.upload(), "uploads", "header.upload"));
  ASSIGN_OR_RETURN(const DatasetRow row, context_.store->GetDataset(upload.scene, upload.number));
  if (row.state == DatasetState::kSealed) {
    return WithResource(absl::FailedPreconditionError(absl::StrCat(header.upload(), " is sealed")),
                        "SEALED", header.upload());
  }
  ASSIGN_OR_RETURN(file_, context_.store->GetDatasetFile(upload.scene, upload.number,
                                                         Utf8Prefix(header.path(), 512)));
  scene_ = upload.scene;
  dataset_ = upload.number;
  file_bytes_ = 0;
  in_file_ = true;
  if (context_.blobs->Has(file_.sha256, file_.size)) return absl::OkStatus();
  ASSIGN_OR_RETURN(writer_, context_.blobs->Begin(file_.sha256, file_.size));
  return absl::OkStatus();
}

absl::Status WriteFilesStream::TakeChunk(const v1::WriteFilesRequest::Chunk& chunk) {
  if (chunk.data().empty() || chunk.data().size() > kMaxChunkBytes) {
    return absl::InvalidArgumentError(absl::StrCat("a chunk of ", chunk.data().size(),
                                                   " bytes, allowed are 1..", kMaxChunkBytes));
  }
  const uint32_t crc = Crc32c(chunk.data());
  if (crc != chunk.crc32c()) {
    return absl::DataLossError(absl::StrCat("the chunk at byte ", file_bytes_, " has the CRC-32C ",
                                            absl::Hex(crc, absl::kZeroPad8), ", sent was ",
                                            absl::Hex(chunk.crc32c(), absl::kZeroPad8)));
  }
  file_bytes_ += static_cast<int64_t>(chunk.data().size());
  if (writer_ == nullptr) return absl::OkStatus();
  return writer_->Append(chunk.data());
}

absl::Status WriteFilesStream::EndFile() {
  if (writer_ != nullptr) RETURN_IF_ERROR(writer_->Commit());
  writer_.reset();
  RETURN_IF_ERROR(context_.store->MarkFileStored(scene_, dataset_, file_.path));
  in_file_ = false;
  response_->set_num_files(response_->num_files() + 1);
  response_->set_num_bytes(response_->num_bytes() + file_bytes_);
  return absl::OkStatus();
}

}  // namespace pepeseg
