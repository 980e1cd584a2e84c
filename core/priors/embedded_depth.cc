#include "core/priors/embedded_depth.h"

#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

#include "core/priors/boundaries.h"
#include "core/priors/photo_channels.h"

namespace pepeseg {
namespace {

constexpr int kDepthExtent = 320;  // pixels; longer side at which a larger photograph is processed
constexpr double kSmoothness = 0.2;  // weight of the difference of two neighbours; a point has 1
// Boundary strength at which that weight has fallen to 1/e, see BoundaryStrength.
constexpr double kEdgeStrength = 0.1;
constexpr int kMinPoints = 16;  // fewest pixels with a point; with fewer the view has no depth
constexpr float kUnknown = std::numeric_limits<float>::quiet_NaN();

// The points that project into one pixel of the shrunk view.
struct Seen {
  double inverse_depth = 0;  // of the nearest point, 1 / scene units
  int count = 0;             // 0: no point, or only hidden ones
};

// Projects the points in front of the camera into an image of width x height.
std::vector<Seen> Project(const View& view, std::span<const ScenePoint> points, int width,
                          int height) {
  std::vector<Seen> seen(static_cast<size_t>(width) * height);
  const Camera& camera = view.camera;
  for (const ScenePoint& point : points) {
    const Eigen::Vector3d in_cam = view.cam_from_world * point.position.cast<double>();
    // Written so that NaN is dropped, here and below.
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

// Sets the count of hidden pixels to 0: those with at least kSeveral pixels within kRadius whose
// points are nearer by the factor kMuchNearer. Such a point shows through a gap between points of a
// surface in front of it.
void RemoveHidden(int width, int height, std::vector<Seen>& seen) {
  constexpr int kRadius = 6;
  constexpr double kMuchNearer = 1.1;
  constexpr int kSeveral = 3;
  // Judged by a copy, so that the result does not depend on the order of the pixels.
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

// Solution of the spread, one value for each pixel. inverse_depth is not normalised: a pixel's
// inverse depth is inverse_depth / support.
struct Spread {
  Eigen::VectorXd inverse_depth;
  Eigen::VectorXd support;  // share that stems from points, in [0, 1]
  bool ok = false;          // false: the factorisation failed
};

// Spreads the points' inverse depths d over the image. The result u minimises
//   sum over pixels with a point of (u_i - d_i)^2  +  sum over neighbours of w_ij (u_i - u_j)^2
//   + kNothing sum of u_i^2,
// w_ij = kSmoothness (exp(-(strength / kEdgeStrength)^2) + 0.001): small across boundaries. Inverse
// depth, because that of a plane is linear in the image. The last part makes the matrix regular;
// the same system with d_i = 1 gives the support, by which its pull to 0 is undone.
class Spreader {
 public:
  Spreader(std::span<const float> strength, int width, int height)
      : strength_(strength), width_(width), height_(height) {}

  Spread Run(std::span<const Seen> seen) const {
    constexpr double kNothing = 3e-5;  // so small that only pixels far from all points feel it
    const auto size = static_cast<Eigen::Index>(seen.size());
    Eigen::VectorXd diagonal = Eigen::VectorXd::Constant(size, kNothing);
    Eigen::VectorXd values = Eigen::VectorXd::Zero(size), ones = values;
    for (Eigen::Index i = 0; i < size; ++i) {
      if (seen[i].count == 0) continue;
      diagonal[i] += 1;
      values[i] = seen[i].inverse_depth;
      ones[i] = 1;
    }
    // Symmetric and positive definite: SimplicialLDLT reads the lower half only, which Join fills
    // in. At most two neighbours and the diagonal a pixel; triplets at one place are summed.
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
  // Adds the entries of a pair of neighbours to the matrix's diagonal and lower half.
  void Join(int a, int b, Eigen::VectorXd& diagonal,
            std::vector<Eigen::Triplet<double>>& entries) const {
    const double strength = double{std::max(strength_[a], strength_[b])} / kEdgeStrength;
    const double weight = kSmoothness * (std::exp(-strength * strength) + 1e-3);
    diagonal[a] += weight;
    diagonal[b] += weight;
    entries.emplace_back(std::max(a, b), std::min(a, b), -weight);
  }

  std::span<const float> strength_;
  int width_, height_;
};

}  // namespace

std::vector<float> EmbeddedDepth(const View& view, std::span<const ScenePoint> points) {
  constexpr double kMinSupport = 0.5;  // below it the pixel is too far from any point
  const Image photo = ShrunkPhoto(view.photo, kDepthExtent);
  std::vector<Seen> seen = Project(view, points, photo.width, photo.height);
  RemoveHidden(photo.width, photo.height, seen);
  const auto num_seen = std::ranges::count_if(seen, [](const Seen& at) { return at.count > 0; });
  if (num_seen < kMinPoints) return {};
  const std::vector<float> strength = BoundaryStrength(ChannelsOf(photo));
  const Spread spread = Spreader(strength, photo.width, photo.height).Run(seen);
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
        // Normalises by the support and inverts: z in the camera's frame, scene units.
        depth[pixel] = static_cast<float>(support / inverse);
      }
    }
  }
  return depth;
}

}  // namespace pepeseg
