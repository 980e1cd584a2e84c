#include "core/reconstruct/blurred_views.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <utility>

#include "core/base/order_statistics.h"

namespace pepeseg {
namespace {

constexpr int kBand = 4;                  // rows that are looked at together
constexpr int kNumBands = 48;             // bands of a photograph, at most about
constexpr int64_t kLeastPixels = 10'000;  // smaller photographs have too few gradients to compare
constexpr size_t kFewViews = 8;           // fewer give no median
constexpr size_t kNearest = 12;           // views that a photograph is compared with

// The brightness of row y; NaN where the view ignores a pixel, so that its differences are NaN,
// too.
std::vector<float> Brightness(const View& view, int y) {
  std::vector<float> row(static_cast<size_t>(view.photo.width));
  for (size_t x = 0; x < row.size(); ++x) {
    const size_t pixel = static_cast<size_t>(y) * row.size() + x;
    const uint8_t* rgb = &view.photo.pixels[3 * pixel];
    const bool ignored = !view.ignore.empty() && view.ignore[pixel] != 0;
    row[x] = ignored ? std::numeric_limits<float>::quiet_NaN()
                     : 0.299f * rgb[0] + 0.587f * rgb[1] + 0.114f * rgb[2];
  }
  return row;
}

// Returns two rows at half their width and height.
std::vector<float> Halved(const std::vector<float>& upper, const std::vector<float>& lower) {
  std::vector<float> row(upper.size() / 2);
  for (size_t x = 0; x < row.size(); ++x) {
    row[x] = 0.25f * (upper[2 * x] + upper[2 * x + 1] + lower[2 * x] + lower[2 * x + 1]);
  }
  return row;
}

// The sum and number of squared gradients.
struct Gradients {
  double sum = 0, num = 0;

  void Add(const std::vector<float>& upper, const std::vector<float>& lower) {
    for (size_t x = 0; x + 1 < upper.size(); ++x) {
      const float right = upper[x + 1] - upper[x], down = lower[x] - upper[x];
      const float squared = right * right + down * down;
      if (std::isnan(squared)) continue;
      sum += squared;
      ++num;
    }
  }
};

// Returns the values of the views nearest to view `own`, itself among them.
std::vector<double> OfNearest(const std::vector<Eigen::Vector3d>& centers, size_t own,
                              const std::vector<double>& values) {
  std::vector<std::pair<double, double>> by_distance;
  for (size_t i = 0; i < centers.size(); ++i) {
    if (!std::isnan(values[i])) {
      by_distance.emplace_back((centers[i] - centers[own]).squaredNorm(), values[i]);
    }
  }
  const size_t count = std::min(kNearest + 1, by_distance.size());
  std::partial_sort(by_distance.begin(), by_distance.begin() + static_cast<ptrdiff_t>(count),
                    by_distance.end());
  std::vector<double> nearest;
  for (size_t i = 0; i < count; ++i) nearest.push_back(by_distance[i].second);
  return nearest;
}

}  // namespace

double Sharpness(const View& view) {
  if (int64_t{view.photo.width} * view.photo.height < kLeastPixels) {
    return std::numeric_limits<double>::quiet_NaN();
  }
  Gradients full, half;
  const int step = std::max(kBand, view.photo.height / kNumBands);
  for (int y = 0; y + kBand <= view.photo.height; y += step) {
    std::array<std::vector<float>, kBand> rows;
    for (int k = 0; k < kBand; ++k) rows[k] = Brightness(view, y + k);
    for (int k = 0; k + 1 < kBand; ++k) full.Add(rows[k], rows[k + 1]);
    half.Add(Halved(rows[0], rows[1]), Halved(rows[2], rows[3]));
  }
  // Where nothing was added, 0 / 0 is NaN.
  const double sharpness = std::log((full.sum / full.num) / (half.sum / half.num));
  return std::isfinite(sharpness) ? sharpness : std::numeric_limits<double>::quiet_NaN();
}

std::vector<bool> FindBlurred(const Capture& capture) {
  std::vector<double> sharpness;
  std::vector<Eigen::Vector3d> centers;
  for (const View& view : capture.views) {
    if (view.held_out) continue;
    sharpness.push_back(Sharpness(view));
    centers.push_back(view.cam_from_world.Inverse().translation);
  }
  std::vector<bool> blurred(sharpness.size(), false);
  if (sharpness.size() < kFewViews) return blurred;
  for (size_t i = 0; i < sharpness.size(); ++i) {
    if (std::isnan(sharpness[i])) continue;
    std::vector<double> nearest = OfNearest(centers, i, sharpness);
    blurred[i] = sharpness[i] < UpperMedian(nearest) - kBlurred;
  }
  return blurred;
}

}  // namespace pepeseg
