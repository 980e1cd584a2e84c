#include "server/services/write_files.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "server/api/error.h"
#include "server/api/resource_name.h"

namespace pepeseg {
namespace {

constexpr size_t kMaxChunkBytes = size_t{4} << 20;
// Bytes that may be received before the stream looks whether its upload was deleted. Until then
// they count against no quota.
constexpr int64_t kCheckedBytes = int64_t{32} << 20;

absl::Status OutOfOrder(const std::string& what) {
  return WithDetail(absl::InvalidArgumentError(what), {.reason = "OUT_OF_ORDER", .field = "part"});
}

absl::Status BusyFile(const std::string& path) {
  return WithDetail(absl::AbortedError(absl::StrCat(path, ": another stream writes it just now")),
                    {.reason = "FILE_BUSY", .resource = path, .retry_after = absl::Seconds(1)});
}

// Commits the complete files. Keeps the part of the file that was being received, unless the upload
// was deleted.
absl::Status Close(const WriteFilesStream::Dependencies& deps, const UploadName& upload,
                   WriteGroup group, std::shared_ptr<BlobWriter> writer) {
  absl::Status status = group.Commit(deps.store, deps.blobs);
  if (writer == nullptr && !absl::IsNotFound(status)) return status;
  // The writer's destructor syncs the bytes and records their number, so that the next stream
  // resumes after them.
  writer.reset();
  if (absl::IsNotFound(deps.store.datasets().GetDataset(upload.scene, upload.number).status())) {
    deps.blobs.RemovePartial(upload);
  }
  return status;
}

}  // namespace

Stream::Step WriteFilesStream::Work(bool io_ok) {
  // The first task of the stream: no message has been read yet.
  if (!caller_.has_value()) {
    absl::Status status = BeginCall();
    if (!status.ok()) return {Next::kEnd, std::move(status)};
    return {Next::kIo, absl::OkStatus()};
  }
  got_message_ = true;
  if (writer_ != nullptr && !writer_->ready()) return Rehash();
  // After the client's last message, `message_` still holds that one.
  if (!io_ok) message_.Clear();
  absl::Status status = Authorize(message_);
  if (!status.ok()) return End(std::move(status));
  if (!io_ok) {
    if (!in_file_) return End(absl::OkStatus());  // commits the last group
    return End(OutOfOrder(absl::StrCat(file_.path, ": the stream ended before its end")));
  }
  status = Take(message_);
  if (!status.ok()) return End(std::move(status));
  if (writer_ != nullptr && !writer_->ready()) return Rehash();
  return {Next::kIo, absl::OkStatus()};
}

Stream::Step WriteFilesStream::Rehash() {
  absl::Status status = OfFile(file_.path, writer_->Rehash());
  if (!status.ok()) return End(std::move(status));
  if (writer_->ready()) return {Next::kIo, absl::OkStatus()};
  Wake();  // again, after what waits for the pool
  return {Next::kIdle, absl::OkStatus()};
}

void WriteFilesStream::OnClosed() {
  if (writer_ == nullptr && group_.empty() && begun_.empty()) return;
  // A pool that has stopped drops the task, whose destructors then block on this thread: the server
  // is ending, so nothing else waits for it.
  deps_.runner.pools().upload.SubmitAlways(
      caller_ ? caller_->project : "",
      [deps = deps_, upload = upload_, group = std::move(group_), writer = std::move(writer_),
       origin = origin_, caller = caller_, named = std::move(named_),
       begun = std::move(begun_)]() mutable {
        absl::Status status = Close(deps, upload, std::move(group), std::move(writer));
        status.Update(absl::CancelledError("the client is gone"));
        if (begun.empty()) return;
        deps.runner.authorizer().Record(origin, *caller, named, status, begun);
      });
}

absl::Duration WriteFilesStream::io_limit() const {
  return got_message_ ? absl::InfiniteDuration() : deps_.runner.streams().limits().first_message;
}

absl::Status WriteFilesStream::BeginCall() {
  ASSIGN_OR_RETURN(
      const AuthorizedCaller caller,
      deps_.runner.authorizer().Authorize(origin_, v1::WriteFilesRequest::default_instance()));
  caller_ = {caller, {}};
  return Admit(OwnerOf(caller, origin_));
}

absl::Status WriteFilesStream::Authorize(const v1::WriteFilesRequest& part) {
  if (!part.has_header()) return absl::OkStatus();
  // Every header is authorised, so that a key that is revoked ends the upload at the next file, and
  // an upload of another project is refused.
  ASSIGN_OR_RETURN(caller_, deps_.runner.authorizer().Authorize(origin_, part));
  // The audit log has the uploads of a stream, not their files.
  if (named_.header().upload() != part.header().upload()) {
    // The files before this one are of the upload before.
    absl::Status status = group_.Commit(deps_.store, deps_.blobs);
    RecordEnd(status);
    RETURN_IF_ERROR(status);
    begun_ = deps_.runner.authorizer().Begin(origin_, *caller_, part);
  }
  named_ = part;
  return absl::OkStatus();
}

void WriteFilesStream::RecordEnd(const absl::Status& status) {
  if (begun_.empty()) return;
  deps_.runner.authorizer().Record(origin_, *caller_, named_, status, std::exchange(begun_, {}));
}

Stream::Step WriteFilesStream::End(absl::Status status) {
  // Closes here, since OnClosed must not block. Of two errors the first one is the cause.
  // OnClosed finds nothing left to do after this.
  status.Update(Close(deps_, upload_, std::exchange(group_, {}), std::exchange(writer_, {})));
  RecordEnd(status);
  return {Next::kEnd, std::move(status)};
}

absl::Status WriteFilesStream::Take(const v1::WriteFilesRequest& part) {
  if (part.has_header()) {
    if (in_file_) return OutOfOrder(absl::StrCat(file_.path, ": no end before the next header"));
    return BeginFile(part.header());
  }
  if (!in_file_) return OutOfOrder("a chunk, an end or nothing where a header must be");
  if (part.has_chunk()) return OfFile(file_.path, TakeChunk(part.chunk()));
  if (part.has_end()) return EndFile();
  return OutOfOrder(absl::StrCat(file_.path, ": a message that is no part"));
}

absl::Status WriteFilesStream::BeginFile(const v1::WriteFilesRequest::Header& header) {
  ASSIGN_OR_RETURN(const SceneChild upload,
                   caller_->scenes.Child(header.upload(), "uploads", "header.upload"));
  RETURN_IF_ERROR(FindFile(header, upload));
  // A file with the same bytes may be complete and wait in the group: then they need not be sent.
  if (group_.Holds(file_.sha256, file_.size)) {
    writer_ = nullptr;
  } else {
    auto writer = deps_.blobs.Begin(upload_, file_.sha256, file_.size);
    if (absl::IsAborted(writer.status())) return BusyFile(file_.path);
    RETURN_IF_ERROR(OfFile(file_.path, writer.status()));
    writer_ = *std::move(writer);
  }
  RETURN_IF_ERROR(StartAt(header));
  file_bytes_ = header.offset();
  sent_bytes_ = 0;
  // Last, so that no chunk is taken for a header that was refused.
  in_file_ = true;
  return absl::OkStatus();
}

// Clients send files in the order of GetUpload, by path, so that one read of the store serves many.
absl::Status WriteFilesStream::FindFile(const v1::WriteFilesRequest::Header& header,
                                        const SceneChild& upload) {
  const std::string path(Utf8Prefix(header.path(), 512));
  const bool same = upload_.scene == upload.scene && upload_.number == upload.number;
  // A group has one upload, since one transaction marks its files.
  if (!same)
    RETURN_IF_ERROR(group_.Commit(deps_.store, deps_.blobs));  // the files are of the other upload
  if (!same || !listed_.contains(path)) {
    RETURN_IF_ERROR(ListFrom(path, header.upload(), upload));
  }
  const auto found = listed_.find(path);
  if (found == listed_.end()) {
    // Returns NOT_FOUND with the names of the upload and the file.
    return deps_.store.files().GetDatasetFile(upload.scene, upload.number, path).status();
  }
  file_ = found->second;
  return absl::OkStatus();
}

absl::Status WriteFilesStream::ListFrom(const std::string& path, const std::string& name,
                                        const SceneChild& upload) {
  // The number of records read at once: two groups.
  constexpr int64_t kListed = 256;
  Store& store = deps_.store;
  listed_.clear();
  ASSIGN_OR_RETURN(const DatasetRecord record,
                   store.datasets().GetDataset(upload.scene, upload.number));
  if (record.state == DatasetState::kSealed) {
    return WithResource(absl::FailedPreconditionError(absl::StrCat(name, " is sealed")), "SEALED",
                        name);
  }
  ASSIGN_OR_RETURN(auto files,
                   store.files().ListDatasetFilesFrom(upload.scene, upload.number, path, kListed));
  for (DatasetFileRecord& file : files) listed_.emplace(file.path, std::move(file));
  upload_ = {upload.scene, upload.number};
  return absl::OkStatus();
}

// Checks the offset at which the client starts. The bytes of a file that is stored already are not
// looked at, so it may start anywhere.
absl::Status WriteFilesStream::StartAt(const v1::WriteFilesRequest::Header& header) {
  // A stored file may be sent again, for example by a client whose first answer was lost: its bytes
  // are received and dropped.
  const bool stored = writer_ == nullptr;
  if (stored && header.offset() >= 0 && header.offset() <= file_.size) return absl::OkStatus();
  const int64_t committed = stored ? file_.size : writer_->committed();
  absl::Status status = stored
                            ? absl::OutOfRangeError(absl::StrCat("the offset is ", header.offset(),
                                                                 " of ", file_.size, " bytes"))
                            : writer_->Start(header.offset());
  if (status.ok()) return status;
  if (!absl::IsOutOfRange(status)) return OfFile(file_.path, status);
  return WithDetail(absl::OutOfRangeError(absl::StrCat(file_.path, ": ", status.message())),
                    {.reason = "WRONG_OFFSET",
                     .field = "header.offset",
                     .resource = file_.path,
                     .limit = absl::StrCat(committed),
                     .value = absl::StrCat(header.offset())});
}

absl::Status WriteFilesStream::TakeChunk(const std::string& chunk) {
  if (chunk.empty() || chunk.size() > kMaxChunkBytes) {
    return absl::InvalidArgumentError(
        absl::StrCat("a chunk of ", chunk.size(), " bytes, allowed are 1..", kMaxChunkBytes));
  }
  // A stored file's chunks are counted like others, so that a client's error shows.
  file_bytes_ += static_cast<int64_t>(chunk.size());
  sent_bytes_ += static_cast<int64_t>(chunk.size());
  if (writer_ == nullptr) return absl::OkStatus();
  unchecked_bytes_ += static_cast<int64_t>(chunk.size());
  if (unchecked_bytes_ >= kCheckedBytes) {
    // NOT_FOUND ends the stream: the collector or a client has deleted the upload.
    RETURN_IF_ERROR(deps_.store.datasets().GetDataset(upload_.scene, upload_.number).status());
    unchecked_bytes_ = 0;
  }
  return writer_->Append(chunk);
}

absl::Status WriteFilesStream::EndFile() {
  if (writer_ != nullptr) RETURN_IF_ERROR(OfFile(file_.path, writer_->Finish()));
  // The writer keeps its descriptor and its lock until the group is committed.
  group_.Add(upload_, {file_, std::exchange(writer_, nullptr)});
  in_file_ = false;
  response_->set_num_files(response_->num_files() + 1);
  response_->set_num_bytes(response_->num_bytes() + sent_bytes_);
  return group_.due() ? group_.Commit(deps_.store, deps_.blobs) : absl::OkStatus();
}

}  // namespace pepeseg
