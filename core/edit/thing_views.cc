#include "core/edit/thing_views.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <numeric>
#include <utility>

#include "core/base/order_statistics.h"
#include "core/base/status_macros.h"
#include "kernels/gaussian_planes.h"

namespace pepeseg {
namespace {

constexpr size_t kMaxSamples = 4096;  // of a thing's Gaussians
constexpr double kInside = 0.98;      // share of the Gaussians that decide where the thing is
constexpr double kMargin = 0.4;       // around a thing, of its longer side in the view
constexpr int kMinSide = 16;          // of a view, pixels
constexpr double kMinSeen = 0.5;      // share of the thing that must be in a view
// A pixel has changed if a channel differs by more, or the depth by more than this share.
constexpr int kMinColorChange = 2;
constexpr float kMinDepthChange = 0.02f;

std::vector<Eigen::Vector3d> Samples(const Gaussians& gaussians, std::span<const int64_t> thing) {
  const size_t stride = std::max<size_t>(1, thing.size() / kMaxSamples);
  std::vector<Eigen::Vector3d> samples;
  for (size_t i = 0; i < thing.size(); i += stride) samples.push_back(MeanOf(gaussians, thing[i]));
  return samples;
}

// Bounds of the middle of some values.
struct Middle {
  double low, high;
};
Middle MiddleOf(std::vector<double> values) {
  return {NearestRank(values, 1 - kInside), NearestRank(values, kInside)};
}

// Returns the bounds of a range with a margin on both sides, within [0, size).
std::pair<int, int> WithMargin(const Middle& range, double margin, int size) {
  const int first = std::clamp(static_cast<int>(std::floor(range.low - margin)), 0, size - 1);
  const int end = std::clamp(static_cast<int>(std::ceil(range.high + margin)), first + 1, size);
  return {first, end};
}

// Returns the part [left, left + width) x [top, top + height) of a view, in its pixels.
ModelView PartOf(const ModelView& view, int left, int top, int width, int height) {
  ModelView part = view;
  part.scores.reset();
  part.photograph.reset();
  Camera camera = view.camera;
  camera.cx -= left, camera.cy -= top;
  camera.width = width, camera.height = height;
  const double shrink =
      std::min(1.0, static_cast<double>(kThingViewSide) / std::max(width, height));
  const auto shrunk = [&](int side) {
    return std::max(kMinSide, static_cast<int>(std::lround(side * shrink)));
  };
  part.camera = Resized(camera, shrunk(width), shrunk(height));
  return part;
}

std::optional<ModelView> PartWith(const ModelView& view, std::span<const Eigen::Vector3d> samples) {
  const Camera& camera = view.camera;
  std::vector<double> xs, ys;
  for (const Eigen::Vector3d& sample : samples) {
    const std::optional<Eigen::Vector2d> at = PixelOf(view, sample);
    if (!at || !IsInView(view, *at)) continue;
    xs.push_back(at->x()), ys.push_back(at->y());
  }
  if (static_cast<double>(xs.size()) < kMinSeen * static_cast<double>(samples.size())) {
    return std::nullopt;
  }
  const Middle across = MiddleOf(std::move(xs)), down = MiddleOf(std::move(ys));
  const double margin =
      kMargin * std::max(across.high - across.low, down.high - down.low) + kMinSide;
  const auto [left, right] = WithMargin(across, margin, camera.width);
  const auto [top, bottom] = WithMargin(down, margin, camera.height);
  if (right - left < kMinSide || bottom - top < kMinSide) return std::nullopt;
  return PartOf(view, left, top, right - left, bottom - top);
}

}  // namespace

std::vector<Eigen::Vector3d> MeansOf(const Gaussians& gaussians, std::span<const int64_t> rows) {
  std::vector<Eigen::Vector3d> means;
  means.reserve(rows.size());
  for (const int64_t row : rows) means.push_back(MeanOf(gaussians, row));
  return means;
}

std::optional<Eigen::Vector2d> PixelOf(const ModelView& view, const Eigen::Vector3d& point) {
  const Eigen::Vector3d p = view.cam_from_world * point;
  if (p.z() <= 0) return std::nullopt;
  const Camera& camera = view.camera;
  return Eigen::Vector2d(camera.fx * p.x() / p.z() + camera.cx,
                         camera.fy * p.y() / p.z() + camera.cy);
}

bool IsInView(const ModelView& view, const Eigen::Vector2d& pixel) {
  return pixel.x() >= 0 && pixel.y() >= 0 && pixel.x() < view.camera.width &&
         pixel.y() < view.camera.height;
}

absl::StatusOr<PixelRows> RowsOfView(const Segmenter& segmenter, const ModelView& view,
                                     const GaussianSet* subset) {
  std::vector<int32_t> pixels(static_cast<size_t>(view.camera.width) * view.camera.height);
  std::iota(pixels.begin(), pixels.end(), 0);
  return segmenter.Rows(view, pixels, subset);
}

ThingSpace SpaceOf(const Gaussians& gaussians, std::span<const int64_t> thing) {
  const std::vector<Eigen::Vector3d> samples = Samples(gaussians, thing);
  ThingSpace space;
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> values;
    for (const Eigen::Vector3d& sample : samples) values.push_back(sample[axis]);
    const Middle range = MiddleOf(std::move(values));
    space.center[axis] = (range.low + range.high) / 2;
  }
  std::vector<double> distances;
  for (const Eigen::Vector3d& sample : samples) distances.push_back((sample - space.center).norm());
  space.radius = NearestRank(distances, kInside);
  return space;
}

std::vector<ModelView> ThingViews(const Model& model, std::span<const int64_t> thing) {
  const std::vector<Eigen::Vector3d> samples = Samples(model.gaussians, thing);
  std::vector<ModelView> all;
  for (const ModelView& view : model.views) {
    if (view.held_out) continue;
    if (std::optional<ModelView> part = PartWith(view, samples)) all.push_back(*std::move(part));
  }
  if (all.size() <= kMaxThingViews) return all;
  std::vector<ModelView> some;
  for (size_t i = 0; i < kMaxThingViews; ++i) {
    some.push_back(std::move(all[i * all.size() / kMaxThingViews]));
  }
  return some;
}

absl::StatusOr<ThingLook> LookWithout(const Segmenter& segmenter, const ModelView& view,
                                      const GaussianSet& rest) {
  ThingLook look;
  ASSIGN_OR_RETURN(const Image with, segmenter.RenderColor(view));
  ASSIGN_OR_RETURN(const std::vector<float> depth_with, segmenter.RenderDepth(view));
  ASSIGN_OR_RETURN(look.color, segmenter.RenderColor(view, &rest));
  ASSIGN_OR_RETURN(look.depth, segmenter.RenderDepth(view, &rest));
  look.changed.resize(look.depth.size());
  for (size_t i = 0; i < look.changed.size(); ++i) {
    int change = 0;
    for (size_t c = 3 * i; c < 3 * i + 3; ++c) {
      change = std::max(change, std::abs(int{with.pixels[c]} - int{look.color.pixels[c]}));
    }
    const float moved = std::abs(look.depth[i] - depth_with[i]);
    look.changed[i] = change > kMinColorChange || moved > kMinDepthChange * depth_with[i]
                          ? uint8_t{1}
                          : uint8_t{0};
  }
  return look;
}

}  // namespace pepeseg
