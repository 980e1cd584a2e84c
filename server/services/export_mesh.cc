#include "server/services/export_mesh.h"

#include <optional>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/digest.h"
#include "core/base/status_macros.h"
#include "core/mesh/make_mesh.h"
#include "core/mesh/simplify.h"
#include "kernels/thread_pool.h"
#include "server/api/convert.h"
#include "server/api/error.h"

namespace pepeseg {
namespace {

// The message that is being filled, and gRPC's copy of the one that is being sent.
constexpr int64_t kMeshMessageBytes = 2 * MeshBlocks::kMaxBlockBytes;
constexpr int64_t kFewestTriangles = 100;

}  // namespace

ExportMeshStream::ExportMeshStream(const Dependencies& deps, grpc::CallbackServerContext* call,
                                   const v1::ExportMeshRequest& request)
    : WriteStream(&deps.runner.streams(), &deps.runner.pools().evaluation),
      deps_(deps),
      call_(call),
      origin_(OriginOf(*call)),
      request_(request) {}

absl::Status ExportMeshStream::Open() {
  ASSIGN_OR_RETURN(caller_, deps_.runner.authorizer().Authorize(origin_, request_));
  RETURN_IF_ERROR(Admit(OwnerOf(caller_, origin_)));
  RETURN_IF_ERROR(deps_.runner.quotas().Admit(caller_.project, request_));
  if (!v1::MeshFormat_IsValid(request_.format())) {
    return BadField("format", absl::StrCat(static_cast<int>(request_.format())), "no format");
  }
  const int voxels = request_.voxels();
  if (voxels != 0 && (voxels < kMinMeshVoxels || voxels > kMaxMeshVoxels)) {
    return BadField("voxels", absl::StrCat(voxels),
                    absl::StrCat("allowed are ", kMinMeshVoxels, "..", kMaxMeshVoxels));
  }
  if (request_.max_triangles() != 0 && request_.max_triangles() < kFewestTriangles) {
    return BadField("max_triangles", absl::StrCat(request_.max_triangles()),
                    absl::StrCat("at least ", kFewestTriangles, ", or 0 for all"));
  }
  ASSIGN_OR_RETURN(const ResidentModel model,
                   deps_.models.Load(caller_.scenes, request_.model(), "model"));
  ASSIGN_OR_RETURN(const std::optional<GaussianSet> subset,
                   deps_.selections.FindSubset(caller_.scenes, model, request_.subset(), "subset"));
  return Make(model, subset ? &*subset : nullptr);
}

absl::Status ExportMeshStream::Make(const ResidentModel& model, const GaussianSet* subset) {
  const Model& of = model->model();
  const int voxels = request_.voxels() != 0 ? request_.voxels() : kDefaultMeshVoxels;
  const absl::StatusOr<VoxelGrid> grid = GridOfMesh(of, subset, voxels);
  if (!grid.ok()) {
    return BadField("voxels", absl::StrCat(voxels), std::string(grid.status().message()));
  }
  ASSIGN_OR_RETURN(memory_,
                   deps_.models.TakeAnswerMemory(model.id.scene.project, BytesOfMesh(*grid, of)));
  TriangleMesh mesh;
  {
    ThreadPool pool(0);
    ASSIGN_OR_RETURN(mesh, MakeMesh(model->segmenter(), subset, *grid,
                                    {.watertight = request_.watertight()}, pool, [this] {
                                      return cancelled()
                                                 ? absl::CancelledError("nobody waits for the mesh")
                                                 : absl::OkStatus();
                                    }));
  }
  // What the volume took is free again.
  memory_.reset();
  if (request_.max_triangles() != 0) {
    ASSIGN_OR_RETURN(memory_,
                     deps_.models.TakeAnswerMemory(model.id.scene.project,
                                                   BytesOfTriangles(mesh) + BytesToSimplify(mesh)));
    Simplify(request_.max_triangles(), mesh);
    memory_.reset();
  }
  ASSIGN_OR_RETURN(memory_,
                   deps_.models.TakeAnswerMemory(model.id.scene.project,
                                                 BytesOfTriangles(mesh) + kMeshMessageBytes));
  v1::ExportMeshResponse::Header& header = *message_.mutable_header();
  header.set_model(model.name);
  header.set_num_vertices(mesh.num_vertices());
  header.set_num_triangles(mesh.num_triangles());
  const bool is_local = request_.coordinates() == v1::COORDINATES_LOCAL;
  if (request_.format() == v1::MESH_FORMAT_GLB) {
    blocks_ = MeshGlb(std::move(mesh), is_local ? Eigen::Vector3d(0, 0, 0) : of.origin);
  } else {
    blocks_ = MeshPly(std::move(mesh), of.origin,
                      is_local ? PlyCoordinates::kLocal : PlyCoordinates::kWorld);
  }
  if (is_local && !of.origin.isZero(0)) {
    *header.mutable_origin() = VectorToProto({of.origin.x(), of.origin.y(), of.origin.z()});
  }
  // The header has the digest of bytes that come after it, so each block is encoded twice.
  Sha256 digest;
  for (int64_t i = 0; i < blocks_->num_blocks(); ++i) digest.Add(blocks_->Encode(i));
  header.set_num_bytes(blocks_->num_bytes());
  header.set_sha256(digest.Hex());
  return absl::OkStatus();
}

Stream::Step ExportMeshStream::Work(bool) {
  if (blocks_ == nullptr) {
    if (absl::Status status = Open(); !status.ok()) return {Next::kEnd, std::move(status)};
    return {Next::kIo, absl::OkStatus()};
  }
  if (next_block_ == blocks_->num_blocks()) return {Next::kEnd, absl::OkStatus()};
  *message_.mutable_chunk() = blocks_->Encode(next_block_++);
  return {Next::kIo, absl::OkStatus()};
}

}  // namespace pepeseg
