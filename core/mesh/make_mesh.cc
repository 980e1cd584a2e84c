#include "core/mesh/make_mesh.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "core/base/order_statistics.h"
#include "core/base/status_macros.h"
#include "core/mesh/surface.h"
#include "core/query/frame.h"

namespace pepeseg {
namespace {

constexpr double kBoxQuantile = 0.01;        // of the Gaussians that may be outside, at each side
constexpr double kBoxMargin = 0.05;          // of the side, added at both ends
constexpr float kMinOpacityLogit = -2.197f;  // of an opacity of 0.1: fainter Gaussians do not count
// Pixels on a voxel in the middle of the box: more of them show nothing more, and cost time.
constexpr double kPixelsPerVoxel = 2;
// Errors of rendered depths, of the distance of the views: the shelf of the demo has holes in its
// things at less.
constexpr double kDepthError = 0.03;
// Views from all around: their distance in radii of the box, and size, pixels.
constexpr double kOutsideDistance = 3;
constexpr int kMaxOutsideSide = 1024;
constexpr int64_t kPixelBytes = 40;  // of a view: depth, colour, and what is found of them

// The Gaussians of which the box is.
std::vector<size_t> MembersOf(const Gaussians& gaussians, const GaussianSet* subset) {
  std::vector<size_t> members, solid;
  const std::span<const float> opacity = gaussians.Plane(kOpacityPlane);
  for (size_t i = 0; i < static_cast<size_t>(gaussians.count); ++i) {
    if (subset != nullptr && subset->member[i] == 0) continue;
    members.push_back(i);
    if (opacity[i] >= kMinOpacityLogit) solid.push_back(i);
  }
  return solid.empty() ? members : solid;
}

// Shrinks a view whose pixels are much smaller than voxels.
ModelView Shrunk(const ModelView& view, const VoxelGrid& grid, const Eigen::Vector3d& middle) {
  const double depth = (view.cam_from_world * middle).z();
  const double pixels = std::max(view.camera.fx, view.camera.fy) * grid.voxel / depth;
  if (depth <= 0 || pixels <= kPixelsPerVoxel) return view;
  const double share = kPixelsPerVoxel / pixels;
  return AtSize(view, std::max(1, static_cast<int>(std::lround(share * view.camera.width))),
                std::max(1, static_cast<int>(std::lround(share * view.camera.height))));
}

// Returns whether a view may show a part of a ball.
bool MaySee(const ModelView& view, const Eigen::Vector3d& middle, double radius) {
  const Eigen::Vector3d at = view.cam_from_world * middle;
  if (at.z() <= -radius) return false;
  const Camera& camera = view.camera;
  // The planes of the picture's four sides go through the centre of the camera.
  const auto is_outside = [&](double coordinate, double focal, double side) {
    return (focal * coordinate - side * at.z()) / std::hypot(focal, side) > radius;
  };
  return !is_outside(at.x(), camera.fx, camera.width - camera.cx) &&
         !is_outside(-at.x(), camera.fx, camera.cx) &&
         !is_outside(at.y(), camera.fy, camera.height - camera.cy) &&
         !is_outside(-at.y(), camera.fy, camera.cy);
}

Eigen::Vector3d MiddleOf(const VoxelGrid& grid) {
  const Eigen::Vector3d size(grid.size[0] - 1, grid.size[1] - 1, grid.size[2] - 1);
  return grid.first + grid.voxel / 2 * size;
}
double RadiusOf(const VoxelGrid& grid) { return (MiddleOf(grid) - grid.first).norm(); }

// Returns the median distance of the views that see the grid; 0: there are none.
double DistanceOf(const Model& model, const VoxelGrid& grid) {
  std::vector<float> distances;
  for (const ModelView& view : model.views) {
    if (!MaySee(view, MiddleOf(grid), RadiusOf(grid))) continue;
    distances.push_back(static_cast<float>((view.cam_from_world * MiddleOf(grid)).norm()));
  }
  return distances.empty() ? 0 : NearestRank(distances, 0.5);
}

// Returns cameras around a ball, in the directions of the faces, edges and corners of a cube.
std::vector<ModelView> OutsideViews(const VoxelGrid& grid, double scene_radius) {
  const Eigen::Vector3d middle = MiddleOf(grid);
  const double radius = RadiusOf(grid);
  // The near plane is at 0.01 of the scene's radius.
  const double distance = std::max(kOutsideDistance * radius, radius + 0.02 * scene_radius);
  const int longest = *std::ranges::max_element(grid.size);
  const int side = std::clamp(2 * longest, 64, kMaxOutsideSide);
  ModelView view;
  view.camera.width = view.camera.height = side;
  view.camera.cx = view.camera.cy = side / 2.0;
  const double sine = radius / distance;
  view.camera.fx = view.camera.fy = side / 2.0 * std::sqrt(1 - sine * sine) / sine;
  std::vector<ModelView> views;
  for (int x = -1; x <= 1; ++x) {
    for (int y = -1; y <= 1; ++y) {
      for (int z = -1; z <= 1; ++z) {
        if (x == 0 && y == 0 && z == 0) continue;
        const Eigen::Vector3d direction = Eigen::Vector3d(x, y, z).normalized();
        view.cam_from_world = LookAt(middle + distance * direction, middle);
        views.push_back(view);
      }
    }
  }
  return views;
}

}  // namespace

Pose LookAt(const Eigen::Vector3d& eye, const Eigen::Vector3d& target) {
  const Eigen::Vector3d forward = (target - eye).normalized();
  const Eigen::Vector3d right = forward.unitOrthogonal();
  Eigen::Matrix3d rotation;
  rotation << right.transpose(), forward.cross(right).transpose(), forward.transpose();
  return {Eigen::Quaterniond(rotation), -(rotation * eye)};
}

absl::StatusOr<VoxelGrid> GridOfMesh(const Model& model, const GaussianSet* subset, int voxels) {
  const Gaussians& gaussians = model.gaussians;
  if (subset != nullptr && subset->member.size() != static_cast<size_t>(gaussians.count)) {
    return absl::InvalidArgumentError("the subset is of another model");
  }
  const std::vector<size_t> members = MembersOf(gaussians, subset);
  if (members.empty()) return absl::InvalidArgumentError("there are no Gaussians to mesh");
  Eigen::Vector3d min, max;
  std::vector<float> low(members.size()), high(members.size());
  for (int axis = 0; axis < 3; ++axis) {
    for (size_t i = 0; i < members.size(); ++i) {
      float log_scale = gaussians.Plane(kLogScalePlane)[members[i]];
      for (int k = 1; k < 3; ++k) {
        log_scale = std::max(log_scale, gaussians.Plane(kLogScalePlane + k)[members[i]]);
      }
      const float mean = gaussians.Plane(kMeanPlane + axis)[members[i]];
      low[i] = mean - std::exp(log_scale);
      high[i] = mean + std::exp(log_scale);
    }
    min[axis] = NearestRank(low, kBoxQuantile);
    max[axis] = NearestRank(high, 1 - kBoxQuantile);
    const double margin = kBoxMargin * (max[axis] - min[axis]);
    min[axis] -= margin;
    max[axis] += margin;
  }
  return GridOf(min, max, voxels);
}

int64_t BytesOfMesh(const VoxelGrid& grid, const Model& model) {
  const int64_t outside = int64_t{kMaxOutsideSide} * kMaxOutsideSide;
  return grid.num_voxels() * kVoxelBytes + grid.MaxVertices() * kSurfaceVertexBytes +
         std::max(outside, LargestView(model.views)) * kPixelBytes;
}

absl::StatusOr<TriangleMesh> MakeMesh(const Segmenter& segmenter, const GaussianSet* subset,
                                      const VoxelGrid& grid, const MeshOptions& options,
                                      ThreadPool& pool, absl::FunctionRef<absl::Status()> check) {
  const Model& model = segmenter.model();
  const Eigen::Vector3d middle = MiddleOf(grid);
  DistanceVolume volume(grid, pool, kDepthError * DistanceOf(model, grid));
  for (const ModelView& full : model.views) {
    if (!MaySee(full, middle, RadiusOf(grid))) continue;
    const ModelView view = Shrunk(full, grid, middle);
    ASSIGN_OR_RETURN(const std::vector<float> depth, segmenter.RenderDepth(view, subset));
    ASSIGN_OR_RETURN(const Image color, segmenter.RenderColor(view, subset));
    // A scene has dark places that need no Gaussians, which are no way through it.
    volume.Fuse(view, depth, color, /*empty_is_outside=*/subset != nullptr);
    RETURN_IF_ERROR(check());
  }
  if (options.watertight) {
    for (const ModelView& view : OutsideViews(grid, model.scene_radius)) {
      ASSIGN_OR_RETURN(const std::vector<float> depth, segmenter.RenderDepth(view, subset));
      volume.Carve(view, depth);
      RETURN_IF_ERROR(check());
    }
  }
  ASSIGN_OR_RETURN(Surface surface, volume.FindSurface(options.watertight));
  DropIslands(options.min_island, surface);
  if (std::ranges::count(surface.is_seen, uint8_t{1}) == 0) {
    return absl::FailedPreconditionError("no view shows a surface of these Gaussians");
  }
  RETURN_IF_ERROR(check());
  SmoothUnseen(surface);
  FillColors(surface);
  SetNormals(surface.mesh);
  return std::move(surface.mesh);
}

}  // namespace pepeseg
