#include "core/priors/embedded_depth.h"

#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

#include "core/priors/boundary_strength.h"
#include "core/priors/photo_channels.h"
#include "core/priors/shrunk_photo.h"

namespace pepeseg {
namespace {

constexpr float kUnknown = std::numeric_limits<float>::quiet_NaN();

// What the points say of one pixel of the small view.
struct Seen {
  double inverse_depth = 0;  // of the nearest point
  int count = 0;
};

// The points in front of the camera, by the pixel that they fall on.
std::vector<Seen> Project(const View& view, std::span<const ScenePoint> points, int width,
                          int height) {
  std::vector<Seen> seen(static_cast<size_t>(width) * height);
  const Camera& camera = view.camera;
  for (const ScenePoint& point : points) {
    const Eigen::Vector3d in_cam = view.cam_from_world * point.position.cast<double>();
    if (!(in_cam.z() > 0)) continue;
    const double u = (camera.fx * in_cam.x() / in_cam.z() + camera.cx) / camera.width * width;
    const double v = (camera.fy * in_cam.y() / in_cam.z() + camera.cy) / camera.height * height;
    if (!(u >= 0 && v >= 0 && u < width && v < height)) continue;
    Seen& at = seen[static_cast<size_t>(v) * width + static_cast<size_t>(u)];
    at.inverse_depth = std::max(at.inverse_depth, 1 / in_cam.z());
    ++at.count;
  }
  return seen;
}

// A point with several much nearer ones close by shows through between them.
void RemoveHidden(int width, int height, std::vector<Seen>& seen) {
  constexpr int kRadius = 6;
  constexpr double kMuchNearer = 1.1;
  constexpr int kSeveral = 3;
  const std::vector<Seen> all = seen;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      Seen& at = seen[static_cast<size_t>(y) * width + x];
      if (at.count == 0) continue;
      int num_nearer = 0;
      for (int v = std::max(0, y - kRadius); v <= std::min(height - 1, y + kRadius); ++v) {
        for (int u = std::max(0, x - kRadius); u <= std::min(width - 1, x + kRadius); ++u) {
          const Seen& other = all[static_cast<size_t>(v) * width + u];
          num_nearer += other.inverse_depth > kMuchNearer * at.inverse_depth ? 1 : 0;
        }
      }
      if (num_nearer >= kSeveral) at.count = 0;
    }
  }
}

// Inverse depths u that minimise the sum over seen pixels of (u - inverse_depth)^2, and over
// neighbours of smoothness * (difference of their u)^2, less across boundaries: planes stay planes,
// as their inverse depth is linear in the image. Beside them how much of each stems from points.
struct Spread {
  Eigen::VectorXd inverse_depth, support;
  bool ok = false;
};
class Spreader {
 public:
  Spreader(std::span<const float> strength, int width, int height,
           const EmbeddedDepthOptions& options)
      : strength_(strength), width_(width), height_(height), options_(options) {}

  Spread Run(std::span<const Seen> seen) const {
    constexpr double kNothing = 3e-5;  // pulls towards support 0 what no point reaches
    const auto size = static_cast<Eigen::Index>(seen.size());
    Eigen::VectorXd diagonal = Eigen::VectorXd::Constant(size, kNothing);
    Eigen::VectorXd values = Eigen::VectorXd::Zero(size), ones = values;
    for (Eigen::Index i = 0; i < size; ++i) {
      if (seen[i].count == 0) continue;
      diagonal[i] += 1;
      values[i] = seen[i].inverse_depth;
      ones[i] = 1;
    }
    std::vector<Eigen::Triplet<double>> entries;
    entries.reserve(seen.size() * 5);
    for (int y = 0; y < height_; ++y) {
      for (int x = 0; x < width_; ++x) {
        const int at = y * width_ + x;
        if (x + 1 < width_) Join(at, at + 1, diagonal, entries);
        if (y + 1 < height_) Join(at, at + width_, diagonal, entries);
      }
    }
    for (Eigen::Index i = 0; i < size; ++i) {
      entries.emplace_back(static_cast<int>(i), static_cast<int>(i), diagonal[i]);
    }
    Eigen::SparseMatrix<double> matrix(size, size);
    matrix.setFromTriplets(entries.begin(), entries.end());
    const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(matrix);
    if (solver.info() != Eigen::Success) return {};
    return {solver.solve(values), solver.solve(ones), true};
  }

 private:
  void Join(int a, int b, Eigen::VectorXd& diagonal,
            std::vector<Eigen::Triplet<double>>& entries) const {
    const double strength = double{std::max(strength_[a], strength_[b])} / options_.edge_strength;
    const double weight = options_.smoothness * (std::exp(-strength * strength) + 1e-3);
    diagonal[a] += weight;
    diagonal[b] += weight;
    entries.emplace_back(std::max(a, b), std::min(a, b), -weight);  // the lower half
  }

  std::span<const float> strength_;
  int width_, height_;
  const EmbeddedDepthOptions& options_;
};

}  // namespace

std::vector<float> EmbeddedDepth(const View& view, std::span<const ScenePoint> points,
                                 const EmbeddedDepthOptions& options) {
  constexpr double kMinSupport = 0.5;
  const Image photo = ShrunkPhoto(view.photo, options.max_extent);
  std::vector<Seen> seen = Project(view, points, photo.width, photo.height);
  RemoveHidden(photo.width, photo.height, seen);
  const auto num_seen = std::ranges::count_if(seen, [](const Seen& at) { return at.count > 0; });
  if (num_seen < options.min_points) return {};
  const std::vector<float> strength = BoundaryStrength(ChannelsOf(photo));
  const Spread spread = Spreader(strength, photo.width, photo.height, options).Run(seen);
  if (!spread.ok) return {};
  const int width = view.photo.width, height = view.photo.height;
  std::vector<float> depth(static_cast<size_t>(width) * height, kUnknown);
  for (int y = 0; y < height; ++y) {
    const int64_t row = int64_t{y} * photo.height / height * photo.width;
    for (int x = 0; x < width; ++x) {
      const size_t pixel = static_cast<size_t>(y) * width + x;
      const int64_t at = row + int64_t{x} * photo.width / width;
      const double support = spread.support[at], inverse = spread.inverse_depth[at];
      const bool ignored = !view.ignore.empty() && view.ignore[pixel] != 0;
      if (!ignored && support >= kMinSupport && inverse > 0) {
        depth[pixel] = static_cast<float>(support / inverse);
      }
    }
  }
  return depth;
}

}  // namespace pepeseg
