#include "server/services/render_service.h"

#include <algorithm>
#include <fstream>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/str_cat.h"
#include "core/base/digest.h"
#include "core/base/status_macros.h"
#include "core/formats/gaussian_ply.h"
#include "core/model_files/manifest.h"
#include "grpcpp/server_context.h"
#include "server/api/error.h"
#include "server/api/resource_name.h"
#include "server/rpc/stream.h"
#include "server/rpc/stream_registry.h"
#include "server/worker_protocol/job_folder.h"

namespace pepeseg {
namespace {

constexpr int64_t kChunkBytes = int64_t{1} << 20;
constexpr char kPlyName[] = "gaussians.ply";
// The message that is being filled, and gRPC's copy of the one that is being sent.
constexpr int64_t kMessageBytes = 2 * kChunkBytes;
// Blocks that a task digests, so that a large subset does not monopolise a thread of the pool.
constexpr int64_t kBlocksPerTask = 16;

// An ExportGaussians call. The PLY file of a whole model is sent from the disk in chunks; the
// stream ends with DATA_LOSS if its digest is not that of the manifest. The PLY of a subset, or of
// a whole model in other coordinates than the stored ones, is encoded twice, block by block: once
// for the size and the digest in the header, once to be sent. That holds the indices of the subset
// and one block in memory, which are reserved in the models' memory budget. A reader that does not
// take a message for StreamLimits::stuck_export loses the stream.
class ExportGaussiansStream final : public WriteStream<v1::ExportGaussiansResponse> {
 public:
  // What the stream works on; it must outlive the stream.
  struct Parts {
    const CallRunner& runner;
    ModelLoader& models;
    const Selections& selections;
  };
  ExportGaussiansStream(const Parts& parts, grpc::CallbackServerContext* call,
                        const v1::ExportGaussiansRequest& request)
      : WriteStream(&parts.runner.streams(),
                    request.has_subset() ? &parts.runner.pools().query : &parts.runner.pools().io),
        parts_(parts),
        call_(call),
        origin_(OriginOf(*call)),
        request_(request) {}

 private:
  Step Work(bool io_ok) override;
  absl::Duration io_limit() const override { return parts_.runner.streams().limits().stuck_export; }
  void CancelCall() override { call_->TryCancel(); }
  absl::Status Open();
  absl::Status OpenModel();
  // Returns false if the request means all of the model.
  absl::StatusOr<bool> OpenSubset();
  // Encodes these Gaussians; nullptr: all.
  absl::Status EncodeSubset(ResidentModel model, const GaussianSet* subset);
  // Reserves memory for what the export holds in addition to the model: `bytes` and a chunk.
  absl::Status TakeMemory(const SceneRef& scene, int64_t bytes);
  // Digests some blocks of the subset. After the last one it fills the header.
  Step DigestSome();
  absl::Status FillChunk();
  absl::Status FillBytes(std::string& bytes);

  const Parts parts_;
  grpc::CallbackServerContext* const call_;
  const CallOrigin origin_;
  AuthorizedCaller caller_;
  v1::ExportGaussiansRequest request_;
  bool opened_ = false;
  std::unique_ptr<ReservedMemory> memory_;
  std::ifstream file_;                       // the PLY of a whole model
  std::optional<ResidentModel> model_;       // the subset refers to it
  std::optional<GaussianPlyBlocks> subset_;  // the PLY of a subset
  int64_t num_digested_ = 0;                 // number of blocks of the subset that are digested
  int64_t next_block_ = 0;                   // the block of the subset to send next
  Sha256 digest_;
  std::string sha256_;  // the digest of a whole model in its manifest
  int64_t num_bytes_left_ = 0;
};

absl::Status ExportGaussiansStream::Open() {
  opened_ = true;
  ASSIGN_OR_RETURN(caller_, parts_.runner.authorizer().AuthorizeAndResolve(origin_, request_));
  RETURN_IF_ERROR(Admit(OwnerOf(caller_, origin_)));
  RETURN_IF_ERROR(parts_.runner.quotas().Admit(caller_.project, request_));
  // Quotas and memory are taken before anything is sent, so that a refusal is the call's status.
  ASSIGN_OR_RETURN(const bool is_subset, OpenSubset());
  return is_subset ? absl::OkStatus() : OpenModel();
}

absl::Status ExportGaussiansStream::TakeMemory(const SceneRef& scene, int64_t bytes) {
  ASSIGN_OR_RETURN(memory_, parts_.models.TakeAnswerMemory(scene.project, bytes + kMessageBytes));
  return absl::OkStatus();
}

absl::StatusOr<bool> ExportGaussiansStream::OpenSubset() {
  if (!request_.has_subset()) return false;
  ASSIGN_OR_RETURN(ResidentModel model,
                   parts_.models.Load(caller_.scenes, request_.model(), "model"));
  ASSIGN_OR_RETURN(
      const std::optional<GaussianSet> subset,
      parts_.selections.FindSubset(caller_.scenes, model, request_.subset(), "subset"));
  if (!subset) return false;
  RETURN_IF_ERROR(EncodeSubset(std::move(model), &*subset));
  return true;
}

absl::Status ExportGaussiansStream::EncodeSubset(ResidentModel model, const GaussianSet* subset) {
  const Model& of = model->model();
  const int64_t count = subset == nullptr ? of.gaussians.count : subset->count();
  RETURN_IF_ERROR(TakeMemory(model.row.scene, count * static_cast<int64_t>(sizeof(uint32_t))));
  std::vector<uint32_t> indices;
  // The size is exact, so the vector takes what was reserved in the budget.
  indices.reserve(static_cast<size_t>(count));
  for (size_t i = 0; i < static_cast<size_t>(of.gaussians.count); ++i) {
    if (subset == nullptr || subset->member[i] != 0) indices.push_back(static_cast<uint32_t>(i));
  }
  const bool local = request_.coordinates() == v1::PLY_COORDINATES_LOCAL;
  subset_.emplace(of.gaussians, std::move(indices), of.origin,
                  local ? PlyCoordinates::kLocal : PlyCoordinates::kWorld);
  if (local && !of.origin.isZero(0)) {
    v1::Vector3& origin = *message_.mutable_header()->mutable_origin();
    origin.set_x(of.origin.x());
    origin.set_y(of.origin.y());
    origin.set_z(of.origin.z());
  }
  model_ = std::move(model);
  num_bytes_left_ = subset_->num_bytes();
  return absl::OkStatus();
}

Stream::Step ExportGaussiansStream::DigestSome() {
  const int64_t end = std::min(num_digested_ + kBlocksPerTask, subset_->num_blocks());
  // The header has the digest of bytes that come after it, so all blocks are encoded before the
  // first is sent, and again to be sent. Storing them would take as much memory as the file.
  for (; num_digested_ < end; ++num_digested_) digest_.Add(subset_->Encode(num_digested_));
  if (end < subset_->num_blocks()) {
    Wake();  // again, after what waits for the pool
    return {Next::kIdle, absl::OkStatus()};
  }
  v1::ExportGaussiansResponse::Header& header = *message_.mutable_header();
  header.set_model(model_->name);
  header.set_num_gaussians(subset_->num_gaussians());
  header.set_num_bytes(subset_->num_bytes());
  header.set_sha256(digest_.Hex());
  return {Next::kIo, absl::OkStatus()};
}

absl::Status ExportGaussiansStream::OpenModel() {
  ASSIGN_OR_RETURN(const ModelRow model,
                   parts_.models.Find(caller_.scenes, request_.model(), "model"));
  RETURN_IF_ERROR(CheckModelFolder(parts_.models.data_folder(), model.folder));
  RETURN_IF_ERROR(TakeMemory(model.scene, 0));
  const std::filesystem::path folder = parts_.models.data_folder() / model.folder;
  if (request_.coordinates() == v1::PLY_COORDINATES_LOCAL) {
    // The stored file is in the world. Only where it has doubles is the local one another.
    ASSIGN_OR_RETURN(const GaussianPlyShape shape,
                     ReadGaussianPlyShape(folder / kPlyName, kPlyName));
    if (shape.has_doubles) {
      ASSIGN_OR_RETURN(ResidentModel resident,
                       parts_.models.Load(caller_.scenes, request_.model(), "model"));
      return EncodeSubset(std::move(resident), nullptr);
    }
  }
  ASSIGN_OR_RETURN(const Manifest manifest, ReadManifest(folder));
  const auto entry =
      std::find_if(manifest.files.begin(), manifest.files.end(),
                   [](const ManifestEntry& listed) { return listed.name == kPlyName; });
  if (entry == manifest.files.end()) {
    return absl::DataLossError(absl::StrCat(kPlyName, ": not in the model's manifest"));
  }
  // The digest in the header is the manifest's, and FillBytes compares the bytes with it at the
  // end. A file that cannot be opened fails at the first read.
  sha256_ = entry->sha256;
  num_bytes_left_ = entry->size;
  file_.open(folder / kPlyName, std::ios::binary);
  v1::ExportGaussiansResponse::Header& header = *message_.mutable_header();
  header.set_model(ChildName(model.scene, "models", model.number));
  header.set_num_gaussians(model.num_gaussians);
  header.set_num_bytes(entry->size);
  header.set_sha256(entry->sha256);
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
  v1::ExportGaussiansResponse::Chunk& chunk = *message_.mutable_chunk();
  RETURN_IF_ERROR(FillBytes(*chunk.mutable_data()));
  chunk.set_crc32c(Crc32c(chunk.data()));
  num_bytes_left_ -= static_cast<int64_t>(chunk.data().size());
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

}  // namespace

RenderServiceRpc::RenderServiceRpc(const CallRunner& runner, ModelLoader& models,
                                   const Selections& selections)
    : runner_(runner), models_(models), selections_(selections) {}

absl::Status RenderServiceRpc::RenderView(const UnaryCall& call,
                                          const v1::RenderViewRequest& request,
                                          v1::RenderViewResponse* response) const {
  return answers_.Render(call, request, response);
}

grpc::ServerWriteReactor<v1::ExportGaussiansResponse>* RenderServiceRpc::ExportGaussians(
    grpc::CallbackServerContext* call, const v1::ExportGaussiansRequest* request) {
  const auto stream = std::make_shared<ExportGaussiansStream>(
      ExportGaussiansStream::Parts{runner_, models_, selections_}, call, *request);
  stream->Begin();
  return stream.get();  // owns itself until OnDone
}

}  // namespace pepeseg
