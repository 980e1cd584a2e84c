#include "server/rpc/export_selection.h"

#include <algorithm>
#include <string>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/status_macros.h"
#include "server/jobs/crc32c.h"
#include "server/rpc/error.h"
#include "server/rpc/model_lookup.h"
#include "server/rpc/resource_name.h"
#include "server/rpc/sha256.h"

namespace pepeseg {
namespace {

constexpr int64_t kChunkBytes = int64_t{1} << 20;
constexpr char kPlyName[] = "gaussians.ply";

}  // namespace

absl::Status ExportSelectionStream::Open() {
  ASSIGN_OR_RETURN(const ModelRow model, FindModel(context_, request_.model(), "model"));
  path_ = context_.data_folder / model.folder / kPlyName;
  std::error_code error;
  num_bytes_left_ = static_cast<int64_t>(std::filesystem::file_size(path_, error));
  if (error) return absl::DataLossError(absl::StrCat(kPlyName, ": ", error.message()));
  v1::ExportSelectionResponse::Header& header = *message_.mutable_header();
  ASSIGN_OR_RETURN(*header.mutable_sha256(), Sha256OfFile(path_));
  header.set_model(ChildName(model.scene, "models", model.number));
  header.set_num_gaussians(model.num_gaussians);
  header.set_num_bytes(num_bytes_left_);
  file_.open(path_, std::ios::binary);
  return absl::OkStatus();
}

absl::Status ExportSelectionStream::FillChunk() {
  const int64_t size = std::min(kChunkBytes, num_bytes_left_);
  v1::ExportSelectionResponse::Chunk& chunk = *message_.mutable_chunk();
  chunk.mutable_data()->resize(static_cast<size_t>(size));
  if (!file_.read(chunk.mutable_data()->data(), size)) {
    return absl::DataLossError(absl::StrCat(kPlyName, ": cannot be read to its end"));
  }
  chunk.set_crc32c(Crc32c(chunk.data()));
  num_bytes_left_ -= size;
  return absl::OkStatus();
}

Stream::Step ExportSelectionStream::Work(bool) {
  absl::Status status;
  if (path_.empty()) {
    status = Open();
  } else if (num_bytes_left_ == 0) {
    return {Next::kEnd, absl::OkStatus()};
  } else {
    status = FillChunk();
  }
  if (!status.ok()) return {Next::kEnd, std::move(status)};
  return {Next::kIo, absl::OkStatus()};
}

}  // namespace pepeseg
