#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "core/mesh/surface.h"
#include "core/render/renderer.h"
#include "core/scene/capture.h"
#include "kernels/thread_pool.h"

namespace pepeseg {

// Voxels on the longest side of the box of a mesh.
inline constexpr int kMinMeshVoxels = 32, kMaxMeshVoxels = 1024, kDefaultMeshVoxels = 256;
// Largest volume, voxels: 512^3. It takes kVoxelBytes for each, which is 1.9 GB.
inline constexpr int64_t kMaxVolumeVoxels = int64_t{1} << 27;
inline constexpr int64_t kVoxelBytes = 14;
inline constexpr double kTruncationVoxels = 4;

// A regular grid of voxels. The centre of voxel (x, y, z) is first + voxel * (x, y, z).
struct VoxelGrid {
  Eigen::Vector3d first = Eigen::Vector3d::Zero();  // scene units
  double voxel = 1;                                 // size of a voxel, scene units
  std::array<int, 3> size{};

  int64_t num_voxels() const { return int64_t{size[0]} * size[1] * size[2]; }
  // Returns the largest number of vertices of a surface, so that its memory has a bound: 24 times
  // the voxels of three sides, where a ball that fills the box has 6 times these.
  int64_t MaxVertices() const {
    return 24 *
           (int64_t{size[0]} * size[1] + int64_t{size[1]} * size[2] + int64_t{size[2]} * size[0]);
  }
};

// Returns the grid of a box with `voxels` voxels on its longest side and a border of a few more on
// each side. INVALID_ARGUMENT: `voxels` is out of range, or the volume would have more than
// kMaxVolumeVoxels.
absl::StatusOr<VoxelGrid> GridOf(const Eigen::Vector3d& min, const Eigen::Vector3d& max,
                                 int voxels);

// A truncated signed distance to the surface that views see, and its colour, at each voxel (Curless
// and Levoy, 1996). Distances are positive outside. Every voxel is computed on its own, so that the
// result does not depend on the number of threads.
class DistanceVolume {
 public:
  // Allocates the volume. truncation: the distance up to which it knows the distance, scene units;
  // more than the errors of the depths. At least kTruncationVoxels voxels are taken. `pool` must
  // outlive it.
  DistanceVolume(const VoxelGrid& grid, ThreadPool& pool, double truncation = 0);

  const VoxelGrid& grid() const { return grid_; }
  double truncation() const { return truncation_; }

  // Adds what a view shows. depth: along the optical axis, scene units, [height, width], 0: none.
  // color: RGB of the same size. A pixel counts by the cosine of the angle between its ray and the
  // surface's normal. Left out are pixels at which the depth jumps by more than the truncation.
  // empty_is_outside: where neither a pixel nor its neighbours have a depth, the whole ray is
  // outside, as it is where a thing is rendered alone; else such pixels are left out.
  void Fuse(const Viewpoint& view, std::span<const float> depth, const Image& color,
            bool empty_is_outside = true);
  // Makes voxels that no fused view has seen count as outside where the view sees nothing in front
  // of or behind them. Other unseen voxels count as inside.
  void Carve(const Viewpoint& view, std::span<const float> depth);

  // Returns the surface where the distance is 0. Unless it is watertight it ends where voxels are
  // unseen. RESOURCE_EXHAUSTED: it has more than grid().MaxVertices().
  absl::StatusOr<Surface> FindSurface(bool watertight) const;

 private:
  struct Pixels;
  Pixels PixelsOf(const Viewpoint& view, std::span<const float> depth) const;
  size_t IndexOf(int x, int y, int z) const {
    return (static_cast<size_t>(z) * grid_.size[1] + y) * grid_.size[0] + x;
  }
  template <typename Body>
  void ForEachSeen(const Pixels& pixels, Body body);

  class Extraction;

  const VoxelGrid grid_;
  ThreadPool& pool_;
  const double truncation_;
  std::vector<float> distance_;   // [voxels] mean, in truncations, [-1, 1]; -1 where unseen
  std::vector<uint16_t> weight_;  // [voxels] of distance_; 0: no fused view has seen the voxel
  // [voxels] mean R, G, B, in 1/256, and the number of views that it is of.
  std::vector<std::array<uint16_t, 4>> color_;
};

}  // namespace pepeseg
