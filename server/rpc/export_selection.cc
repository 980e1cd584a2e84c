#include "server/rpc/export_selection.h"

#include <algorithm>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/io/gaussian_ply.h"
#include "core/io/manifest.h"
#include "core/status_macros.h"
#include "server/jobs/crc32c.h"
#include "server/jobs/job_folder.h"
#include "server/rpc/error.h"
#include "server/rpc/model_lookup.h"
#include "server/rpc/resource_name.h"
#include "server/rpc/subset_lookup.h"

namespace pepeseg {
namespace {

constexpr int64_t kChunkBytes = int64_t{1} << 20;
constexpr char kPlyName[] = "gaussians.ply";

}  // namespace

absl::Status ExportSelectionStream::Open() {
  opened_ = true;
  ASSIGN_OR_RETURN(const Caller caller, context_.authorizer->Authorize(origin_, request_));
  RETURN_IF_ERROR(context_.quotas->Admit(caller.project, request_));
  ASSIGN_OR_RETURN(const bool is_subset, MakeSubset());
  return is_subset ? absl::OkStatus() : OpenModel();
}

absl::StatusOr<bool> ExportSelectionStream::MakeSubset() {
  if (!request_.has_subset()) return false;
  ASSIGN_OR_RETURN(const ResidentModel model, LoadModel(context_, request_.model(), "model"));
  ASSIGN_OR_RETURN(const std::optional<GaussianSet> subset,
                   FindSubset(context_, model, request_.subset(), "subset"));
  if (!subset) return false;
  const Gaussians& gaussians = model.segmenter->model().gaussians;
  const Eigen::Vector3d& origin = model.segmenter->model().origin;
  std::vector<int64_t> rows;
  rows.reserve(static_cast<size_t>(subset->count()));
  for (int64_t i = 0; i < gaussians.count; ++i) {
    if (subset->member[i] != 0) rows.push_back(i);
  }
  subset_ = EncodeGaussianPly(gaussians.Select(rows), origin);
  sha256_ = Sha256Hex(subset_);
  num_bytes_left_ = static_cast<int64_t>(subset_.size());
  v1::ExportSelectionResponse::Header& header = *message_.mutable_header();
  header.set_model(model.name);
  header.set_num_gaussians(static_cast<int64_t>(rows.size()));
  header.set_num_bytes(num_bytes_left_);
  header.set_sha256(sha256_);
  return true;
}

absl::Status ExportSelectionStream::OpenModel() {
  ASSIGN_OR_RETURN(const ModelRow model, FindModel(context_, request_.model(), "model"));
  RETURN_IF_ERROR(CheckModelFolder(context_.data_folder, model.folder));
  const std::filesystem::path folder = context_.data_folder / model.folder;
  ASSIGN_OR_RETURN(const Manifest manifest, ReadManifest(folder));
  const auto entry =
      std::find_if(manifest.files.begin(), manifest.files.end(),
                   [](const ManifestEntry& listed) { return listed.name == kPlyName; });
  if (entry == manifest.files.end()) {
    return absl::DataLossError(absl::StrCat(kPlyName, ": not in the model's manifest"));
  }
  sha256_ = entry->sha256;
  num_bytes_left_ = entry->size;
  file_.open(folder / kPlyName, std::ios::binary);
  v1::ExportSelectionResponse::Header& header = *message_.mutable_header();
  header.set_model(ChildName(model.scene, "models", model.number));
  header.set_num_gaussians(model.num_gaussians);
  header.set_num_bytes(entry->size);
  header.set_sha256(entry->sha256);
  return absl::OkStatus();
}

absl::Status ExportSelectionStream::FillChunk() {
  const int64_t size = std::min(kChunkBytes, num_bytes_left_);
  v1::ExportSelectionResponse::Chunk& chunk = *message_.mutable_chunk();
  chunk.mutable_data()->resize(static_cast<size_t>(size));
  if (!subset_.empty()) {
    chunk.set_data(subset_.substr(subset_.size() - static_cast<size_t>(num_bytes_left_),
                                  static_cast<size_t>(size)));
  } else if (!file_.read(chunk.mutable_data()->data(), size)) {
    return absl::DataLossError(absl::StrCat(kPlyName, ": cannot be read to its end"));
  }
  chunk.set_crc32c(Crc32c(chunk.data()));
  num_bytes_left_ -= size;
  digest_.Add(chunk.data());
  if (num_bytes_left_ == 0 && digest_.Hex() != sha256_) {
    return absl::DataLossError(absl::StrCat(kPlyName, ": fails its checksum"));
  }
  return absl::OkStatus();
}

Stream::Step ExportSelectionStream::Work(bool) {
  absl::Status status;
  if (!opened_) {
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
