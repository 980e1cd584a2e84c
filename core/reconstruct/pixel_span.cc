#include "core/reconstruct/pixel_span.h"

#include <algorithm>
#include <limits>

namespace pepeseg {
namespace {

constexpr size_t kMostViews = 256, kMostPoints = 1024;

// Returns the upper median, or 0 without values. Reorders the values.
double Median(std::vector<double>& values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<int64_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// Returns the median depth of the points in front of the view, or 0 without any.
double DepthOfPoints(const View& view, const std::vector<ScenePoint>& points) {
  const size_t stride = (points.size() + kMostPoints - 1) / kMostPoints;
  std::vector<double> depths;
  for (size_t i = 0; i < points.size(); i += stride) {
    const double depth = (view.cam_from_world * points[i].position.cast<double>()).z();
    if (depth > 0) depths.push_back(depth);
  }
  return Median(depths);
}

}  // namespace

double PixelSpan(const Capture& capture, const std::vector<ScenePoint>& points) {
  const size_t stride = (capture.views.size() + kMostViews - 1) / kMostViews;
  std::vector<double> spans;
  for (size_t i = 0; i < capture.views.size(); i += stride) {
    const View& view = capture.views[i];
    const double depth = DepthOfPoints(view, points);
    if (depth > 0) spans.push_back(depth / std::max(view.camera.fx, view.camera.fy));
  }
  const double span = Median(spans);
  return span > 0 ? span : std::numeric_limits<double>::infinity();
}

}  // namespace pepeseg
