#pragma once

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/mesh/distance_volume.h"
#include "core/query/segmenter.h"
#include "core/scene/camera.h"
#include "core/scene/triangle_mesh.h"
#include "kernels/thread_pool.h"

namespace pepeseg {

struct MeshOptions {
  bool watertight = false;
  // Connected parts with fewer triangles than this share of those of the largest one are dropped.
  // 0: none.
  double min_island = 0.01;
};

// Returns the grid of the mesh of a subset; null: of all Gaussians. voxels: on the longest side of
// its box, which has the middle 98 % of the Gaussians on each axis and a little more, so that a few
// that are far away do not make the voxels larger. Errors are those of GridOf; INVALID_ARGUMENT:
// the subset is empty or of another model.
absl::StatusOr<VoxelGrid> GridOfMesh(const Model& model, const GaussianSet* subset, int voxels);

// Returns an upper bound of the host's memory that MakeMesh takes for a grid, bytes: the volume, a
// view and the largest surface.
int64_t BytesOfMesh(const VoxelGrid& grid, const Model& model);

// Makes a mesh of a subset of the Gaussians; null: of all. grid: of GridOfMesh. Fuses the depth and
// the colours that the model's views render of them into a DistanceVolume. A watertight mesh is
// closed: what no view sees counts as inside unless it is outside the silhouette of the Gaussians,
// seen from all around.
//
// The device is used once for each view; everything else runs on `pool`, and does not depend on its
// number of threads. Calls `check` after each view; an error that it returns ends the work with
// that error. Other errors are those of FindSurface and Segmenter::RenderDepth;
// FAILED_PRECONDITION: the views show no surface.
absl::StatusOr<TriangleMesh> MakeMesh(const Segmenter& segmenter, const GaussianSet* subset,
                                      const VoxelGrid& grid, const MeshOptions& options,
                                      ThreadPool& pool, absl::FunctionRef<absl::Status()> check);

// Returns the pose of a camera at `eye` that looks at `target`. Up is up in no world: its pictures
// are of depth only.
Pose LookAt(const Eigen::Vector3d& eye, const Eigen::Vector3d& target);

}  // namespace pepeseg
