#include "core/features/mask_scales.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "core/features/masks_of_patch.h"

namespace pepeseg {
namespace {

constexpr int kMinPixels = 8;
constexpr int kMajority = 5;  // of 3x3

struct Moments {
  int64_t count = 0;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  Eigen::Vector3d squares = Eigen::Vector3d::Zero();

  double Scale() const {
    if (count < kMinPixels) return kNoScale;
    const Eigen::Vector3d mean = sum / static_cast<double>(count);
    const Eigen::Vector3d variance = squares / static_cast<double>(count) - mean.cwiseProduct(mean);
    return 2 * std::sqrt(std::max(0.0, variance.sum()));
  }
};

// The masks that cover at least five of the nine pixels about (x, y), as a bitset.
class MajorityFilter {
 public:
  explicit MajorityFilter(const MaskSet& masks) : masks_(masks), count_(masks.num_masks) {}

  template <class Fn>
  void ForEachMask(int x, int y, Fn&& fn) {
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
  void Add(int x, int y) {
    ForEachMaskIn(masks_.BitsAt(x, y), [this](int mask) {
      if (count_[mask]++ == 0) touched_.push_back(mask);
    });
  }

  const MaskSet& masks_;
  std::vector<int> count_;  // [num_masks]
  std::vector<int> touched_;
};

// False when none is over 0.
bool SortPositive(std::vector<float>& scales) {
  std::erase_if(scales, [](float scale) { return scale <= kNoScale; });
  std::sort(scales.begin(), scales.end());
  return !scales.empty();
}

float Quantile(const std::vector<float>& sorted, double share) {
  const double position = share * static_cast<double>(sorted.size() - 1);
  const auto low = static_cast<size_t>(position);
  const size_t high = std::min(low + 1, sorted.size() - 1);
  return static_cast<float>(
      std::lerp(double{sorted[low]}, double{sorted[high]}, position - static_cast<double>(low)));
}

}  // namespace

std::vector<float> MaskScales(const View& view, std::span<const float> depth) {
  std::vector<Moments> moments(view.masks.num_masks);
  MajorityFilter filter(view.masks);
  const Camera& camera = view.camera;
  for (int y = 0; y < camera.height && !view.masks.empty(); ++y) {
    for (int x = 0; x < camera.width; ++x) {
      const size_t pixel = static_cast<size_t>(y) * camera.width + x;
      if (depth[pixel] <= 0 || (!view.ignore.empty() && view.ignore[pixel] != 0)) continue;
      const double z = depth[pixel];
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
  constexpr double kLargest = 0.99;
  if (!SortPositive(scales)) return {};
  const double low = double{scales.front()}, high = double{Quantile(scales, kLargest)};
  std::vector<float> knots;
  knots.reserve(kNumScaleKnots);
  for (int k = 0; k < kNumScaleKnots; ++k) {
    const double share = static_cast<double>(k) / (kNumScaleKnots - 1);
    knots.push_back(static_cast<float>(std::lerp(low, high, share)));
  }
  return knots;
}

}  // namespace pepeseg
