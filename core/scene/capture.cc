#include "core/scene/capture.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>

#include "core/base/order_statistics.h"

namespace pepeseg {
namespace {

constexpr double kLowShare = 0.001, kHighShare = 0.999;  // of the known values

Eigen::Vector3d CenterOf(const View& view) { return view.cam_from_world.Inverse().translation; }

// Returns the median distance from `from` to the points, or 0 if there are none. Uses every n-th
// point where there are more than `kMost`.
double DistanceToPoints(const Capture& capture, const Eigen::Vector3d& from) {
  constexpr size_t kMost = 100'000;
  const size_t stride = std::max<size_t>(1, capture.points.size() / kMost);
  std::vector<double> distances;
  for (size_t i = 0; i < capture.points.size(); i += stride) {
    distances.push_back((capture.points[i].position.cast<double>() - from).norm());
  }
  return distances.empty() ? 0 : UpperMedian(distances);
}

}  // namespace

std::vector<float> NormalizeDepth(std::vector<float> values) {
  std::vector<float> known;
  known.reserve(values.size());
  std::copy_if(values.begin(), values.end(), std::back_inserter(known),
               [](float value) { return !std::isnan(value); });
  if (known.empty()) return {};
  const float low = NearestRank(known, kLowShare);
  const float range = NearestRank(known, kHighShare) - low;
  // The two percentiles are equal, or a value is infinite.
  if (!(range > 0) || !std::isfinite(range)) return {};
  for (float& value : values) {
    if (!std::isnan(value)) value = std::clamp((value - low) / range, 0.0f, 1.0f);
  }
  return values;
}

// The maximum distance, not the mean, as in 3DGS.
double SceneRadius(const Capture& capture) {
  constexpr double kMargin = 1.1;
  // A smaller share of the distance to the points gives next to no parallax.
  constexpr double kOnePlace = 1e-3;
  // A smaller share of the coordinates is rounding error.
  constexpr double kRounding = 1e-12;
  if (capture.views.empty()) return 1;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const View& view : capture.views) mean += CenterOf(view);
  mean /= static_cast<double>(capture.views.size());
  double radius = 0;
  for (const View& view : capture.views) {
    radius = std::max(radius, (CenterOf(view) - mean).norm());
  }
  const double distance = DistanceToPoints(capture, mean);
  if (distance > 0 && radius < kOnePlace * distance) return distance;
  return radius > kRounding * mean.norm() ? kMargin * radius : 1;
}

std::vector<int32_t> KnownGridPixels(const View& view, double max_cells) {
  std::vector<int32_t> pixels = GridPixels(view.camera, max_cells);
  if (!view.ignore.empty()) std::erase_if(pixels, [&](int32_t p) { return view.ignore[p] != 0; });
  return pixels;
}

bool HasDepthPrior(const View& view) {
  return std::ranges::any_of(view.depth.values, [](float value) { return !std::isnan(value); });
}

bool HasTrainingDepth(const Capture& capture) {
  return std::ranges::any_of(
      capture.views, [](const View& view) { return !view.held_out && HasDepthPrior(view); });
}

bool HasGeometryPrior(const View& view) { return !view.depth.from_points && HasDepthPrior(view); }

bool HasTrainingGeometry(const Capture& capture) {
  return std::ranges::any_of(
      capture.views, [](const View& view) { return !view.held_out && HasGeometryPrior(view); });
}

}  // namespace pepeseg
