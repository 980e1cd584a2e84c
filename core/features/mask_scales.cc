#include "core/features/mask_scales.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>

#include "core/base/order_statistics.h"

namespace pepeseg {
namespace {

constexpr int kMinPixels = 8;  // of a mask that has a scale, after the filter
constexpr int kMajority = 5;   // of the 3x3 pixels of the filter

// Sums over the points of a mask. Coordinates are of the camera, where the trace of the covariance
// is the same as in the world.
struct Moments {
  int64_t count = 0;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  Eigen::Vector3d squares = Eigen::Vector3d::Zero();

  double Scale() const {
    if (count < kMinPixels) return kNoScale;
    // GARField, equation 2: twice the root of the summed variances. E[x^2] - E[x]^2 in double;
    // rounding can leave it just below 0.
    const Eigen::Vector3d mean = sum / static_cast<double>(count);
    const Eigen::Vector3d variance = squares / static_cast<double>(count) - mean.cwiseProduct(mean);
    return 2 * std::sqrt(std::max(0.0, variance.sum()));
  }
};

// Finds the masks that cover at least kMajority of the nine pixels around a pixel. At the image's
// border the missing pixels count as uncovered.
class MajorityFilter {
 public:
  explicit MajorityFilter(const MaskSet& masks) : masks_(masks), count_(masks.num_masks) {}

  // Calls fn(mask) for each of these masks of (x, y), in no particular order.
  template <class Fn>
  void ForEachMask(int x, int y, Fn&& fn) {
    if (IsWithinACell(x, y)) return ForEachMaskIn(masks_.BitsAt(x, y), fn);
    touched_.clear();
    for (int v = std::max(0, y - 1); v <= std::min(masks_.height - 1, y + 1); ++v) {
      for (int u = std::max(0, x - 1); u <= std::min(masks_.width - 1, x + 1); ++u) Add(u, v);
    }
    for (const int mask : touched_) {
      if (count_[mask] >= kMajority) fn(mask);
      count_[mask] = 0;
    }
  }

 private:
  // Returns whether all nine pixels are of one mask cell.
  bool IsWithinACell(int x, int y) const {
    if (x == 0 || y == 0 || x + 1 == masks_.width || y + 1 == masks_.height) return false;
    const auto width = static_cast<size_t>(masks_.width);
    const size_t first = static_cast<size_t>(y - 1) * width + x - 1;
    const uint32_t cell = masks_.pixel_cell[first];
    for (int row = 0; row < 3; ++row) {
      const uint32_t* cells = masks_.pixel_cell.data() + first + row * width;
      if (cells[0] != cell || cells[1] != cell || cells[2] != cell) return false;
    }
    return true;
  }
  void Add(int x, int y) {
    ForEachMaskIn(masks_.BitsAt(x, y), [this](int mask) {
      if (count_[mask]++ == 0) touched_.push_back(mask);
    });
  }

  const MaskSet& masks_;
  std::vector<int> count_;    // [num_masks] pixels of the window; 0 between two calls
  std::vector<int> touched_;  // masks of the window
};

// Sorts the scales that are over 0 and removes the others. Returns whether any is left.
bool SortPositive(std::vector<float>& scales) {
  std::erase_if(scales, [](float scale) { return scale <= kNoScale; });
  std::sort(scales.begin(), scales.end());
  return !scales.empty();
}

// Returns the quantile at `share` in [0, 1]. `sorted` must not be empty.
float Quantile(const std::vector<float>& sorted, double share) {
  // Interpolates linearly between the two nearest order statistics.
  const double position = share * static_cast<double>(sorted.size() - 1);
  const auto low = static_cast<size_t>(position);
  const size_t high = std::min(low + 1, sorted.size() - 1);
  return static_cast<float>(
      std::lerp(double{sorted[low]}, double{sorted[high]}, position - static_cast<double>(low)));
}

// Returns even steps from the smallest scale to the quantile `largest`.
std::vector<float> EvenKnots(std::vector<float> scales, double largest) {
  if (!SortPositive(scales)) return {};
  const double low = double{scales.front()}, high = double{Quantile(scales, largest)};
  std::vector<float> knots;
  knots.reserve(kNumScaleKnots);
  for (int k = 0; k < kNumScaleKnots; ++k) {
    const double share = static_cast<double>(k) / (kNumScaleKnots - 1);
    knots.push_back(static_cast<float>(std::lerp(low, high, share)));
  }
  return knots;
}

}  // namespace

std::vector<int> TrainedViews(const Capture& capture) {
  std::vector<int> trained;
  for (size_t i = 0; i < capture.views.size(); ++i) {
    if (IsTrained(capture.views[i])) trained.push_back(static_cast<int>(i));
  }
  return trained;
}

std::vector<float> MaskScales(const View& view, std::span<const float> depth) {
  std::vector<Moments> moments(view.masks.num_masks);
  MajorityFilter filter(view.masks);
  const Camera& camera = view.camera;
  for (int y = 0; y < camera.height && !view.masks.empty(); ++y) {
    for (int x = 0; x < camera.width; ++x) {
      const size_t pixel = static_cast<size_t>(y) * camera.width + x;
      if (depth[pixel] <= 0 || (!view.ignore.empty() && view.ignore[pixel] != 0)) continue;
      const double z = depth[pixel];
      // In the camera's frame, scene units. `depth` is z, not the distance along the ray; pixel
      // centres lie at + 0.5.
      const Eigen::Vector3d point((x + 0.5 - camera.cx) / camera.fx * z,
                                  (y + 0.5 - camera.cy) / camera.fy * z, z);
      filter.ForEachMask(x, y, [&](int mask) {
        ++moments[mask].count;
        moments[mask].sum += point;
        moments[mask].squares += point.cwiseProduct(point);
      });
    }
  }
  std::vector<float> scales;
  scales.reserve(moments.size());
  for (const Moments& m : moments) scales.push_back(static_cast<float>(m.Scale()));
  return scales;
}

float MedianScale(std::vector<float> scales) { return UpperMedian(scales); }

std::vector<float> ScaleQuantiles(std::vector<float> scales) {
  if (!SortPositive(scales)) return {};
  std::vector<float> knots;
  knots.reserve(kNumScaleKnots);
  for (int k = 0; k < kNumScaleKnots; ++k) {
    knots.push_back(Quantile(scales, static_cast<double>(k) / (kNumScaleKnots - 1)));
  }
  return knots;
}

std::vector<float> EvenScales(std::vector<float> scales) {
  return EvenKnots(std::move(scales), 0.99);
}

std::vector<float> MinMaxScales(std::vector<float> scales) {
  return EvenKnots(std::move(scales), 1);
}

void ScaleLabels(std::span<const uint64_t> cell_bits, std::span<const float> mask_scales,
                 float scale, std::span<uint64_t> out) {
  // METHOD.md section 3, "Labels": all masks with s_M < s, and the finest of the others.
  std::fill(out.begin(), out.end(), uint64_t{0});
  int finest = -1;  // of the masks that are not smaller; the first of equal ones
  const auto keep = [&](int mask) { out[mask / 64] |= uint64_t{1} << (mask % 64); };
  ForEachMaskIn(cell_bits, [&](int mask) {
    if (mask_scales[mask] <= kNoScale) return;
    if (mask_scales[mask] < scale) {
      keep(mask);
    } else if (finest < 0 || mask_scales[mask] < mask_scales[finest]) {
      finest = mask;
    }
  });
  if (finest >= 0) keep(finest);
}

}  // namespace pepeseg
