#include "server/services/export_gaussians.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/formats/gaussian_glb.h"
#include "core/formats/gaussian_html.h"
#include "core/formats/gaussian_ply.h"
#include "core/formats/gaussian_sog.h"
#include "core/formats/gaussian_spz.h"
#include "core/model_files/model_file.h"
#include "core/query/decomposition.h"
#include "kernels/thread_pool.h"
#include "server/api/convert.h"
#include "server/api/decomposition.h"
#include "server/api/error.h"
#include "server/worker_protocol/job_folder.h"

namespace pepeseg {
namespace {

constexpr int64_t kChunkBytes = int64_t{1} << 20;
constexpr char kPlyName[] = "gaussians.ply";
// The message that is being filled, and gRPC's copy of the one that is being sent.
constexpr int64_t kMessageBytes = 2 * kChunkBytes;
// Blocks that a task digests, so that a large subset does not monopolise a thread of the pool.
constexpr int64_t kBlocksPerTask = 16;

// Returns whether the file is a PLY, which is the format of the stored one.
bool IsPly(const v1::ExportGaussiansRequest& request) {
  return request.format() == v1::GAUSSIAN_FORMAT_UNSPECIFIED ||
         request.format() == v1::GAUSSIAN_FORMAT_PLY;
}

// Returns whether the stored file has what the request wants of each Gaussian.
bool WantsStored(const v1::ExportGaussiansRequest& request) {
  return IsPly(request) && !request.has_segment_ids();
}

// Returns whether the call is one of those that compute. Others mostly read the stored file.
bool Computes(const v1::ExportGaussiansRequest& request) {
  return request.has_subset() || !WantsStored(request);
}

// Returns whether positions are relative to the model's origin.
bool IsLocal(const v1::ExportGaussiansRequest& request) {
  return request.coordinates() == v1::COORDINATES_LOCAL;
}

// Returns whether the file leaves the origin of the model to its reader.
bool LeavesOrigin(const v1::ExportGaussiansRequest& request) {
  const v1::GaussianFormat format = request.format();
  return IsLocal(request) || format == v1::GAUSSIAN_FORMAT_SPZ ||
         format == v1::GAUSSIAN_FORMAT_SOG || format == v1::GAUSSIAN_FORMAT_HTML;
}

// Returns the pool on which the call works.
WorkerPool* PoolOf(const CallRunner& runner, const v1::ExportGaussiansRequest& request) {
  // An SOG takes all cores for seconds, as a mesh does.
  if (request.format() == v1::GAUSSIAN_FORMAT_SOG) return &runner.pools().evaluation;
  return Computes(request) ? &runner.pools().query : &runner.pools().io;
}

// INVALID_ARGUMENT: the format cannot hold `count` Gaussians.
absl::Status CheckCount(v1::GaussianFormat format, int64_t count) {
  const auto check = [count](const char* name, int64_t most) {
    if (count <= most) return absl::OkStatus();
    return BadField("format", name,
                    absl::StrCat("has ", count, " Gaussians, at most ", most, " fit"));
  };
  if (format == v1::GAUSSIAN_FORMAT_GLB) return check("GLB", kMaxGlbGaussians);
  if (format == v1::GAUSSIAN_FORMAT_SOG) return check("SOG", kMaxSogGaussians);
  if (format == v1::GAUSSIAN_FORMAT_HTML) return check("HTML", kMaxHtmlGaussians);
  return absl::OkStatus();
}

// Returns the file of these Gaussians in the format of the request, another than an SOG. The model
// must outlive it. `title` is that of a page.
std::unique_ptr<const GaussianBlocks> BlocksOf(const Model& model, std::vector<uint32_t> indices,
                                               SegmentIds segment_ids, std::string title,
                                               const v1::ExportGaussiansRequest& request) {
  if (request.format() == v1::GAUSSIAN_FORMAT_HTML) {
    return std::make_unique<GaussianHtmlBlocks>(model.gaussians, std::move(indices),
                                                SplatPageOf(model, std::move(title)));
  }
  if (request.format() == v1::GAUSSIAN_FORMAT_SPZ) {
    return std::make_unique<GaussianSpzBlocks>(model.gaussians, std::move(indices));
  }
  if (request.format() == v1::GAUSSIAN_FORMAT_GLB) {
    return std::make_unique<GaussianGlbBlocks>(
        model.gaussians, std::move(indices),
        IsLocal(request) ? Eigen::Vector3d(0, 0, 0) : model.origin);
  }
  return std::make_unique<GaussianPlyBlocks>(
      model.gaussians, std::move(indices), model.origin,
      IsLocal(request) ? PlyCoordinates::kLocal : PlyCoordinates::kWorld, std::move(segment_ids));
}

}  // namespace

ExportGaussiansStream::ExportGaussiansStream(const Dependencies& deps,
                                             grpc::CallbackServerContext* call,
                                             const v1::ExportGaussiansRequest& request)
    : WriteStream(&deps.runner.streams(), PoolOf(deps.runner, request)),
      deps_(deps),
      call_(call),
      origin_(OriginOf(*call)),
      request_(request) {}

absl::Status ExportGaussiansStream::Open() {
  opened_ = true;
  ASSIGN_OR_RETURN(caller_, deps_.runner.authorizer().Authorize(origin_, request_));
  RETURN_IF_ERROR(Admit(OwnerOf(caller_, origin_)));
  RETURN_IF_ERROR(deps_.runner.quotas().Admit(caller_.project, request_));
  if (!v1::GaussianFormat_IsValid(request_.format())) {
    return BadField("format", absl::StrCat(static_cast<int>(request_.format())), "no format");
  }
  if (request_.has_segment_ids() && !IsPly(request_)) {
    return BadField("segment_ids", v1::GaussianFormat_Name(request_.format()),
                    "only a PLY has them");
  }
  // Quotas and memory are taken before anything is sent, so that a refusal is the call's status.
  ASSIGN_OR_RETURN(const bool is_subset, OpenSubset());
  return is_subset ? absl::OkStatus() : OpenModel();
}

absl::Status ExportGaussiansStream::TakeMemory(const SceneRef& scene, int64_t bytes) {
  ASSIGN_OR_RETURN(memory_, deps_.models.TakeAnswerMemory(scene.project, bytes + kMessageBytes));
  return absl::OkStatus();
}

absl::StatusOr<bool> ExportGaussiansStream::OpenSubset() {
  if (!Computes(request_)) return false;
  ASSIGN_OR_RETURN(ResidentModel model,
                   deps_.models.Load(caller_.scenes, request_.model(), "model"));
  ASSIGN_OR_RETURN(const std::optional<GaussianSet> subset,
                   deps_.selections.FindSubset(caller_.scenes, model, request_.subset(), "subset"));
  if (!subset && WantsStored(request_)) return false;
  RETURN_IF_ERROR(EncodeSubset(std::move(model), subset ? &*subset : nullptr));
  return true;
}

absl::Status ExportGaussiansStream::EncodeSubset(ResidentModel model, const GaussianSet* subset) {
  const Model& of = model->model();
  const int64_t count = subset == nullptr ? of.gaussians.count : subset->count();
  RETURN_IF_ERROR(CheckCount(request_.format(), count));
  const bool is_sog = request_.format() == v1::GAUSSIAN_FORMAT_SOG;
  // The indices, while an SPZ measures the scene a float of each Gaussian, and the segments' ids.
  const int64_t num_ids = request_.has_segment_ids() ? of.gaussians.count * kMaxLevels : 0;
  RETURN_IF_ERROR(
      TakeMemory(model.id.scene, count * static_cast<int64_t>(sizeof(uint32_t) + sizeof(float)) +
                                     num_ids * static_cast<int64_t>(sizeof(int32_t)) +
                                     (is_sog ? BytesOfSog(count, of.gaussians.sh_degree) : 0)));
  SegmentIds segment_ids;
  if (request_.has_segment_ids()) {
    RETURN_IF_ERROR(CheckFeatures(model));
    ASSIGN_OR_RETURN(segment_ids,
                     FindSegmentIds(*model, request_.segment_ids().scales(), "segment_ids.scales"));
  }
  std::vector<uint32_t> indices;
  // The size is exact, so the vector takes what was reserved in the budget.
  indices.reserve(static_cast<size_t>(count));
  for (size_t i = 0; i < static_cast<size_t>(of.gaussians.count); ++i) {
    if (subset == nullptr || subset->member[i] != 0) indices.push_back(static_cast<uint32_t>(i));
  }
  if (is_sog) {
    RETURN_IF_ERROR(MakeSog(model, std::move(indices)));
  } else {
    std::string title;
    if (request_.format() == v1::GAUSSIAN_FORMAT_HTML) {
      ASSIGN_OR_RETURN(const SceneRecord scene,
                       deps_.models.store().scenes().GetScene(model.id.scene));
      title = scene.display_name.empty() ? scene.scene.name : scene.display_name;
    }
    subset_ = BlocksOf(of, std::move(indices), std::move(segment_ids), std::move(title), request_);
  }
  if (LeavesOrigin(request_) && !of.origin.isZero(0)) {
    *message_.mutable_header()->mutable_origin() =
        VectorToProto({of.origin.x(), of.origin.y(), of.origin.z()});
  }
  model_ = std::move(model);
  return absl::OkStatus();
}

absl::Status ExportGaussiansStream::MakeSog(const ResidentModel& model,
                                            std::vector<uint32_t> indices) {
  const auto num_indices = static_cast<int64_t>(indices.size());
  {
    ThreadPool pool(0);
    ASSIGN_OR_RETURN(
        subset_, MakeGaussianSog(model->model().gaussians, std::move(indices), pool, [this] {
          return cancelled() ? absl::CancelledError("nobody waits for the SOG") : absl::OkStatus();
        }));
  }
  // What the work took is free again: the file and the indices are left.
  memory_.reset();
  return TakeMemory(model.id.scene, subset_->num_blocks() * GaussianBlocks::kMaxBlockBytes +
                                        num_indices * static_cast<int64_t>(sizeof(uint32_t)));
}

Stream::Step ExportGaussiansStream::DigestSome() {
  const int64_t end = std::min(num_digested_ + kBlocksPerTask, subset_->num_blocks());
  // The header has the digest of bytes that come after it, so all blocks are encoded before the
  // first is sent, and again to be sent. Storing them would take as much memory as the file.
  for (; num_digested_ < end; ++num_digested_) {
    const std::string block = subset_->Encode(num_digested_);
    digest_.Add(block);
    num_bytes_left_ += static_cast<int64_t>(block.size());
  }
  if (end < subset_->num_blocks()) {
    Wake();  // again, after what waits for the pool
    return {Next::kIdle, absl::OkStatus()};
  }
  v1::ExportGaussiansResponse::Header& header = *message_.mutable_header();
  header.set_model(model_->name);
  header.set_num_gaussians(subset_->num_gaussians());
  header.set_num_bytes(num_bytes_left_);
  header.set_sha256(digest_.Hex());
  return {Next::kIo, absl::OkStatus()};
}

absl::Status ExportGaussiansStream::OpenModel() {
  ASSIGN_OR_RETURN(const ModelRecord model,
                   deps_.models.Find(caller_.scenes, request_.model(), "model"));
  RETURN_IF_ERROR(CheckModelFolder(deps_.models.data_folder(), model.folder));
  RETURN_IF_ERROR(TakeMemory(model.scene, 0));
  const std::filesystem::path folder = deps_.models.data_folder() / model.folder;
  if (IsLocal(request_)) {
    // The stored file is in the world. Only where it has doubles is the local one another.
    ASSIGN_OR_RETURN(const GaussianPlyShape shape,
                     ReadGaussianPlyShape(folder / kPlyName, kPlyName));
    if (shape.has_doubles) {
      ASSIGN_OR_RETURN(ResidentModel resident,
                       deps_.models.Load(caller_.scenes, request_.model(), "model"));
      return EncodeSubset(std::move(resident), nullptr);
    }
  }
  ASSIGN_OR_RETURN(const ManifestEntry entry, FindListed(folder, kPlyName));
  // The digest in the header is the manifest's, and FillBytes compares the bytes with it at the
  // end. A file that cannot be opened fails at the first read.
  sha256_ = entry.sha256;
  num_bytes_left_ = entry.size;
  file_.open(folder / kPlyName, std::ios::binary);
  v1::ExportGaussiansResponse::Header& header = *message_.mutable_header();
  header.set_model(ChildName(model.scene, "models", model.number));
  header.set_num_gaussians(model.num_gaussians);
  header.set_num_bytes(entry.size);
  header.set_sha256(entry.sha256);
  return absl::OkStatus();
}

absl::Status ExportGaussiansStream::FillBytes(std::string& bytes) {
  if (subset_) {
    bytes = subset_->Encode(next_block_++);
    return absl::OkStatus();
  }
  const int64_t size = std::min(kChunkBytes, num_bytes_left_);
  bytes.resize(static_cast<size_t>(size));
  if (!file_.read(bytes.data(), size)) {
    return absl::DataLossError(absl::StrCat(kPlyName, ": cannot be read to its end"));
  }
  // A subset's bytes are not checked again: they come from memory, not from the disk.
  digest_.Add(bytes);
  if (size == num_bytes_left_ && digest_.Hex() != sha256_) {
    return absl::DataLossError(absl::StrCat(kPlyName, ": fails its checksum"));
  }
  return absl::OkStatus();
}

absl::Status ExportGaussiansStream::FillChunk() {
  std::string& chunk = *message_.mutable_chunk();
  RETURN_IF_ERROR(FillBytes(chunk));
  num_bytes_left_ -= static_cast<int64_t>(chunk.size());
  return absl::OkStatus();
}

Stream::Step ExportGaussiansStream::Work(bool) {
  absl::Status status;
  if (!opened_) {
    status = Open();
    if (status.ok() && subset_) return DigestSome();
  } else if (subset_ && num_digested_ < subset_->num_blocks()) {
    return DigestSome();
  } else if (num_bytes_left_ == 0) {
    return {Next::kEnd, absl::OkStatus()};
  } else {
    status = FillChunk();
  }
  if (!status.ok()) return {Next::kEnd, std::move(status)};
  return {Next::kIo, absl::OkStatus()};
}

}  // namespace pepeseg
