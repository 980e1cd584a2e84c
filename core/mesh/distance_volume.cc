#include "core/mesh/distance_volume.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdlib>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/mesh/cube_table.h"

namespace pepeseg {
namespace {

constexpr int kBorderVoxels = 3;     // on each side of the box
constexpr float kColorBand = 0.5f;   // truncations from the surface that have its colour
constexpr int kMaxPixelWeight = 64;  // of a pixel that faces its camera
constexpr int kMostWeight = 60'000;  // after which a mean follows new values
constexpr int kMostColors = 255;
constexpr float kLeastCosine = 0.1f;
// A vertex keeps this share of its edge from both ends, so that no triangle is a point.
constexpr float kEndShare = 0.01f;

float Square(float value) { return value * value; }

}  // namespace

// A view, prepared for lookups.
struct DistanceVolume::Pixels {
  // What a pixel says of the voxels on its ray.
  enum class Kind : uint8_t { kUnknown, kSurface, kEmpty };

  int width = 0, height = 0;
  Eigen::Matrix3d rotation;
  Eigen::Vector3d translation;
  float fx = 0, fy = 0, cx = 0, cy = 0;
  std::vector<Kind> kind;
  std::span<const float> depth;
  // By pixel: what the distance along the optical axis is multiplied by to become that to the plane
  // tangent to the surface, and the pixel's weight, 1 to kMaxPixelWeight.
  std::vector<float> slope;
  std::vector<uint8_t> weight;
};

absl::StatusOr<VoxelGrid> GridOf(const Eigen::Vector3d& min, const Eigen::Vector3d& max,
                                 int voxels) {
  if (voxels < kMinMeshVoxels || voxels > kMaxMeshVoxels) {
    return absl::InvalidArgumentError(
        absl::StrCat(voxels, " voxels; allowed are ", kMinMeshVoxels, "..", kMaxMeshVoxels));
  }
  VoxelGrid grid;
  const Eigen::Vector3d sides = max - min;
  grid.voxel = sides.maxCoeff() / voxels;
  if (!(grid.voxel > 0) || !std::isfinite(grid.voxel)) {
    return absl::InvalidArgumentError("the box of the mesh has no size");
  }
  for (int k = 0; k < 3; ++k) {
    // The half keeps the longest side from a further voxel by rounding.
    const int inner = std::max(1, static_cast<int>(std::ceil(sides[k] / grid.voxel - 0.5)));
    grid.size[k] = inner + 2 * kBorderVoxels;
    grid.first[k] = (min[k] + max[k]) / 2 - grid.voxel * (grid.size[k] - 1) / 2;
  }
  if (grid.num_voxels() > kMaxVolumeVoxels) {
    // A smaller number shrinks all sides, so that this one fits with the border.
    const double share =
        std::cbrt(static_cast<double>(kMaxVolumeVoxels) / static_cast<double>(grid.num_voxels()));
    return absl::InvalidArgumentError(
        absl::StrCat(voxels, " voxels on the longest side make a volume of ", grid.size[0], " x ",
                     grid.size[1], " x ", grid.size[2], ", more than ", kMaxVolumeVoxels,
                     " voxels; at most ", static_cast<int>(share * voxels) - 1, " fit"));
  }
  return grid;
}

DistanceVolume::DistanceVolume(const VoxelGrid& grid, ThreadPool& pool, double truncation)
    : grid_(grid),
      pool_(pool),
      truncation_(std::max(truncation, kTruncationVoxels * grid.voxel)),
      distance_(static_cast<size_t>(grid.num_voxels()), -1.0f),
      weight_(distance_.size()),
      color_(distance_.size()) {}

DistanceVolume::Pixels DistanceVolume::PixelsOf(const Viewpoint& view,
                                                std::span<const float> depth) const {
  const Camera& camera = view.camera;
  Pixels pixels;
  const int width = pixels.width = camera.width, height = pixels.height = camera.height;
  pixels.rotation = view.cam_from_world.rotation.toRotationMatrix();
  pixels.translation = view.cam_from_world.translation;
  pixels.fx = static_cast<float>(camera.fx);
  pixels.fy = static_cast<float>(camera.fy);
  pixels.cx = static_cast<float>(camera.cx);
  pixels.cy = static_cast<float>(camera.cy);
  pixels.depth = depth;
  pixels.kind.assign(depth.size(), Pixels::Kind::kUnknown);
  pixels.slope.assign(depth.size(), 1.0f);
  pixels.weight.assign(depth.size(), 1);
  const auto jump = static_cast<float>(truncation());
  pool_.ParallelFor(height, [&](int64_t row, int) {
    const int y = static_cast<int>(row);
    for (int x = 0; x < width; ++x) {
      const size_t at = static_cast<size_t>(y) * width + x;
      const float d = depth[at];
      bool is_empty = d == 0, is_smooth = d > 0;
      for (int dy = -1; dy <= 1; ++dy) {
        for (int dx = -1; dx <= 1; ++dx) {
          const int nx = x + dx, ny = y + dy;
          if (nx < 0 || ny < 0 || nx >= width || ny >= height) continue;
          const float other = depth[static_cast<size_t>(ny) * width + nx];
          is_empty = is_empty && other == 0;
          is_smooth = is_smooth && other > 0 && std::abs(other - d) <= jump;
        }
      }
      if (is_empty) pixels.kind[at] = Pixels::Kind::kEmpty;
      if (!is_smooth) continue;
      pixels.kind[at] = Pixels::Kind::kSurface;
      // The inverse of the depth of a plane is linear in the picture: m . (u, v, 1), where u and v
      // are the ray's coordinates and m is the plane's normal divided by its distance.
      const int left = std::max(x - 1, 0), right = std::min(x + 1, width - 1);
      const int up = std::max(y - 1, 0), down = std::min(y + 1, height - 1);
      const auto inverse = [&](int px, int py) {
        return 1 / depth[static_cast<size_t>(py) * width + px];
      };
      const float u = (static_cast<float>(x) + 0.5f - pixels.cx) / pixels.fx;
      const float v = (static_cast<float>(y) + 0.5f - pixels.cy) / pixels.fy;
      const float mx =
          (inverse(right, y) - inverse(left, y)) * pixels.fx / static_cast<float>(right - left);
      const float my =
          (inverse(x, down) - inverse(x, up)) * pixels.fy / static_cast<float>(down - up);
      const float mz = 1 / d - u * mx - v * my;
      const float slope = 1 / (d * std::sqrt(mx * mx + my * my + mz * mz));
      const float cosine = slope / std::sqrt(u * u + v * v + 1);
      if (!(cosine >= kLeastCosine)) {  // also an image of one column or line
        pixels.slope[at] = kLeastCosine;
        continue;
      }
      pixels.slope[at] = slope;
      pixels.weight[at] = static_cast<uint8_t>(
          std::clamp<long>(std::lround(kMaxPixelWeight * cosine), 1, kMaxPixelWeight));
    }
  });
  return pixels;
}

// Calls body(index, pixel, x, y, z) for each voxel whose centre the view can see: the pixel, the
// point in the picture, pixels, and the depth.
template <typename Body>
void DistanceVolume::ForEachSeen(const Pixels& pixels, Body body) {
  const Eigen::Vector3f step = (pixels.rotation.col(0) * grid_.voxel).cast<float>();
  const auto width = static_cast<float>(pixels.width), height = static_cast<float>(pixels.height);
  pool_.ParallelFor(grid_.size[2], [&](int64_t slice, int) {
    const int z = static_cast<int>(slice);
    for (int y = 0; y < grid_.size[1]; ++y) {
      const Eigen::Vector3d world = grid_.first + grid_.voxel * Eigen::Vector3d(0, y, z);
      const Eigen::Vector3f row = (pixels.rotation * world + pixels.translation).cast<float>();
      const size_t first = IndexOf(0, y, z);
      for (int x = 0; x < grid_.size[0]; ++x) {
        const auto shift = static_cast<float>(x);
        const float depth = row.z() + shift * step.z();
        if (depth <= 0) continue;
        const float px = (row.x() + shift * step.x()) / depth * pixels.fx + pixels.cx;
        const float py = (row.y() + shift * step.y()) / depth * pixels.fy + pixels.cy;
        if (!(px >= 0 && px < width && py >= 0 && py < height)) continue;
        const size_t pixel = static_cast<size_t>(py) * pixels.width + static_cast<size_t>(px);
        body(first + x, pixel, px, py, depth);
      }
    }
  });
}

void DistanceVolume::Fuse(const Viewpoint& view, std::span<const float> depth, const Image& color,
                          bool empty_is_outside) {
  const Pixels pixels = PixelsOf(view, depth);
  const auto scale = static_cast<float>(1 / truncation());
  // The depth of the surface at a point of the picture.
  const auto depth_at = [&](size_t pixel, float px, float py) {
    const int x = static_cast<int>(px - 0.5f), y = static_cast<int>(py - 0.5f);
    if (px < 0.5f || py < 0.5f || x + 1 >= pixels.width || y + 1 >= pixels.height) {
      return depth[pixel];
    }
    const size_t at = static_cast<size_t>(y) * pixels.width + x;
    for (const size_t i : {at, at + 1, at + pixels.width, at + pixels.width + 1}) {
      if (pixels.kind[i] != Pixels::Kind::kSurface) return depth[pixel];
    }
    const float u = px - 0.5f - static_cast<float>(x), v = py - 0.5f - static_cast<float>(y);
    const float upper = depth[at] + u * (depth[at + 1] - depth[at]);
    const float lower =
        depth[at + pixels.width] + u * (depth[at + pixels.width + 1] - depth[at + pixels.width]);
    return upper + v * (lower - upper);
  };
  ForEachSeen(pixels, [&](size_t voxel, size_t pixel, float px, float py, float z) {
    const Pixels::Kind kind = pixels.kind[pixel];
    if (kind == Pixels::Kind::kUnknown) return;
    if (kind == Pixels::Kind::kEmpty && !empty_is_outside) return;
    float value = 1;
    int weight = kMaxPixelWeight;
    if (kind == Pixels::Kind::kSurface) {
      const float along = depth_at(pixel, px, py) - z;
      value = along * pixels.slope[pixel] * scale;
      if (value < -1) return;
      value = std::min(value, 1.0f);
      weight = pixels.weight[pixel];
      // Behind the surface there may be another one, such as behind the edge of a box: what is
      // further behind counts less.
      if (value < 0) weight = static_cast<int>(static_cast<float>(weight) * Square(1 + value));
      if (weight == 0) return;
      if (std::abs(value) <= kColorBand) {
        std::array<uint16_t, 4>& mean = color_[voxel];
        if (mean[3] < kMostColors) ++mean[3];
        for (int k = 0; k < 3; ++k) {
          const int wanted = color.pixels[3 * pixel + k] << 8;
          mean[k] = static_cast<uint16_t>(mean[k] + (wanted - mean[k]) / mean[3]);
        }
      }
    }
    const int before = weight_[voxel];
    const int after = std::min(before + weight, kMostWeight);
    float& mean = distance_[voxel];
    mean = before == 0 ? value
                       : mean + (value - mean) * static_cast<float>(weight) /
                                    static_cast<float>(before + weight);
    weight_[voxel] = static_cast<uint16_t>(after);
  });
}

void DistanceVolume::Carve(const Viewpoint& view, std::span<const float> depth) {
  const Pixels pixels = PixelsOf(view, depth);
  ForEachSeen(pixels, [&](size_t voxel, size_t pixel, float, float, float) {
    if (weight_[voxel] == 0 && depth[pixel] == 0) distance_[voxel] = 1;
  });
}

// Finds the surface slice by slice. A slice is the voxels of one z and the edges that begin at
// them; the vertices of a slice are numbered in the order of its voxels and axes.
class DistanceVolume::Extraction {
 public:
  Extraction(const DistanceVolume& volume, bool watertight)
      : volume_(volume), size_(volume.grid_.size), watertight_(watertight) {}

  absl::StatusOr<Surface> Run() {
    const int num_slices = size_[2];
    std::vector<int64_t> first_vertex(num_slices + 1), first_triangle(num_slices + 1);
    volume_.pool_.ParallelFor(num_slices, [&](int64_t slice, int) {
      const int z = static_cast<int>(slice);
      first_vertex[z + 1] = NumberVertices(z, nullptr);
      first_triangle[z + 1] = CountTriangles(z);
    });
    for (int z = 0; z < num_slices; ++z) {
      first_vertex[z + 1] += first_vertex[z];
      first_triangle[z + 1] += first_triangle[z];
    }
    const int64_t num_vertices = first_vertex.back();
    const int64_t most = volume_.grid_.MaxVertices();
    if (num_vertices > most) {
      return absl::ResourceExhaustedError(
          absl::StrCat("the surface has ", num_vertices, " vertices, more than the ", most,
                       " that a volume of this size may have; mesh a part of the scene"));
    }
    Surface surface;
    surface.mesh.positions.resize(static_cast<size_t>(num_vertices));
    surface.mesh.colors.resize(surface.mesh.positions.size());
    surface.is_seen.resize(surface.mesh.positions.size());
    surface.has_color.resize(surface.mesh.positions.size());
    surface.mesh.triangles.resize(static_cast<size_t>(first_triangle.back()));
    volume_.pool_.ParallelFor(num_slices, [&](int64_t slice, int) {
      const int z = static_cast<int>(slice);
      Numbers here, above;
      NumberVertices(z, &here);
      PlaceVertices(z, here, first_vertex[z], surface);
      if (z + 1 == num_slices) return;
      NumberVertices(z + 1, &above);
      AddTriangles(z, here, above, &first_vertex[z], surface.mesh.triangles, first_triangle[z]);
    });
    return surface;
  }

 private:
  // The number within its slice of the vertex on the edge from each voxel along each axis.
  using Numbers = std::vector<std::array<uint32_t, 3>>;  // [slice]

  // Distances of the voxels at the border of a watertight volume are outside.
  float ValueAt(int x, int y, int z) const {
    if (watertight_ && (x == 0 || y == 0 || z == 0 || x == size_[0] - 1 || y == size_[1] - 1 ||
                        z == size_[2] - 1)) {
      return 1;
    }
    return volume_.distance_[volume_.IndexOf(x, y, z)];
  }
  // Returns whether the surface is known at a voxel.
  bool IsKnown(size_t voxel) const { return watertight_ || volume_.weight_[voxel] != 0; }

  // Calls body(x, y, axis) for each edge from a voxel of the slice that has a vertex.
  template <typename Body>
  void ForEachVertex(int z, Body body) const {
    const bool has_next = z + 1 < size_[2];
    for (int y = 0; y < size_[1]; ++y) {
      for (int x = 0; x < size_[0]; ++x) {
        if (!IsKnown(volume_.IndexOf(x, y, z))) continue;
        const bool inside = ValueAt(x, y, z) < 0;
        for (int axis = 0; axis < 3; ++axis) {
          const int nx = x + (axis == 0), ny = y + (axis == 1), nz = z + (axis == 2);
          if (nx == size_[0] || ny == size_[1] || (axis == 2 && !has_next)) continue;
          if (inside == (ValueAt(nx, ny, nz) < 0) || !IsKnown(volume_.IndexOf(nx, ny, nz))) {
            continue;
          }
          body(x, y, axis);
        }
      }
    }
  }
  int64_t NumberVertices(int z, Numbers* numbers) const {
    if (numbers != nullptr) numbers->resize(static_cast<size_t>(size_[0]) * size_[1]);
    uint32_t count = 0;
    ForEachVertex(z, [&](int x, int y, int axis) {
      if (numbers != nullptr) (*numbers)[static_cast<size_t>(y) * size_[0] + x][axis] = count;
      ++count;
    });
    return count;
  }

  // Calls body(x, y, inside) for each cube of the slice through which the surface goes.
  template <typename Body>
  void ForEachCube(int z, Body body) const {
    if (z + 1 == size_[2]) return;
    for (int y = 0; y + 1 < size_[1]; ++y) {
      for (int x = 0; x + 1 < size_[0]; ++x) {
        unsigned inside = 0;
        bool is_known = true;
        for (int c = 0; c < 8; ++c) {
          const int cx = x + (c & 1), cy = y + (c >> 1 & 1), cz = z + (c >> 2);
          is_known = is_known && IsKnown(volume_.IndexOf(cx, cy, cz));
          if (ValueAt(cx, cy, cz) < 0) inside |= 1u << c;
        }
        if (is_known && inside != 0 && inside != 255) body(x, y, inside);
      }
    }
  }
  int64_t CountTriangles(int z) const {
    int64_t count = 0;
    ForEachCube(z, [&](int, int, unsigned inside) {
      count += static_cast<int64_t>(CubeTable()[inside].size());
    });
    return count;
  }

  void PlaceVertices(int z, const Numbers& numbers, int64_t first, Surface& surface) const {
    const VoxelGrid& grid = volume_.grid_;
    ForEachVertex(z, [&](int x, int y, int axis) {
      const size_t vertex =
          static_cast<size_t>(first) + numbers[static_cast<size_t>(y) * size_[0] + x][axis];
      const int nx = x + (axis == 0), ny = y + (axis == 1), nz = z + (axis == 2);
      const float a = ValueAt(x, y, z), b = ValueAt(nx, ny, nz);
      const float share = std::clamp(a / (a - b), kEndShare, 1 - kEndShare);
      Eigen::Vector3d at(x, y, z);
      at[axis] += share;
      surface.mesh.positions[vertex] = (grid.first + grid.voxel * at).cast<float>();
      const size_t from = volume_.IndexOf(x, y, z), to = volume_.IndexOf(nx, ny, nz);
      surface.is_seen[vertex] = volume_.weight_[from] != 0 && volume_.weight_[to] != 0;
      const std::array<uint16_t, 4>&ca = volume_.color_[from], &cb = volume_.color_[to];
      const float wa = ca[3] == 0 ? 0 : 1 - share, wb = cb[3] == 0 ? 0 : share;
      if (wa + wb == 0) return;
      surface.has_color[vertex] = 1;
      for (int k = 0; k < 3; ++k) {
        const float mean = (wa * ca[k] + wb * cb[k]) / (wa + wb) / 256;
        surface.mesh.colors[vertex][k] = static_cast<uint8_t>(std::min(255L, std::lround(mean)));
      }
    });
  }

  // first: of the vertices of this slice and the next.
  void AddTriangles(int z, const Numbers& here, const Numbers& above, const int64_t* first,
                    std::vector<std::array<uint32_t, 3>>& triangles, int64_t at) const {
    ForEachCube(z, [&](int x, int y, unsigned inside) {
      for (const std::array<uint8_t, 3>& edges : CubeTable()[inside]) {
        std::array<uint32_t, 3>& triangle = triangles[static_cast<size_t>(at++)];
        for (int i = 0; i < 3; ++i) {
          const CubeEdge& edge = kCubeEdges[edges[i]];
          const size_t in_slice =
              static_cast<size_t>(y + (edge.from >> 1 & 1)) * size_[0] + x + (edge.from & 1);
          const bool is_above = edge.from >> 2 != 0;
          triangle[i] = static_cast<uint32_t>(first[is_above ? 1 : 0]) +
                        (is_above ? above : here)[in_slice][edge.axis];
        }
      }
    });
  }

  const DistanceVolume& volume_;
  const std::array<int, 3> size_;
  const bool watertight_;
};

absl::StatusOr<Surface> DistanceVolume::FindSurface(bool watertight) const {
  return Extraction(*this, watertight).Run();
}

}  // namespace pepeseg
