#include "core/query/border.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

namespace pepeseg {
namespace {

// Radius of the window in which a side is described, pixels.
constexpr int kRadius = 2;
// Added to the variances of gated features and of colours in [0, 1]: smaller differences are noise.
constexpr float kFeatureNoise = 0.01f, kColorNoise = 0.001f;
// Weight of the evidence of colour. An object may have many colours, but hardly two features.
constexpr float kColorWeight = 0.3f;
// Least evidence that moves a pixel to the other side.
constexpr float kClear = 1;
// Greatest distance of the similarity from the threshold, cosine, with which a pixel may move.
constexpr double kUncertain = 0.1;

static_assert(kBorderReach == kRadius + 2, "a deep pixel of the window has neighbours of its own");

// Gated feature, colour, and a 0 that makes the number a multiple of four.
constexpr int kNumValues = kFeatureSize + 4;
using Values = std::array<float, kNumValues>;

// Where a pixel lies.
enum Place : uint8_t { kDeepOutside, kBorderOutside, kBorderInside, kDeepInside };

bool IsBorder(Place place) { return place == kBorderOutside || place == kBorderInside; }
bool IsInside(Place place) { return place == kBorderInside || place == kDeepInside; }

// The pixels of one side in a window.
struct Side {
  Values mean{};
  float feature_variance = 0, color_variance = 0;  // sums over the components
};

float SquaredDistance(const float* a, const float* b, int count) {
  float sum = 0;
  for (int k = 0; k < count; ++k) sum += (a[k] - b[k]) * (a[k] - b[k]);
  return sum;
}

// Mean and variance of some pixels.
class SideSum {
 public:
  void Add(const Values& values) {
    ++count_;
    for (int k = 0; k < kNumValues; ++k) {
      sum_[k] += values[k];
      squares_[k] += values[k] * values[k];
    }
  }
  int count() const { return count_; }
  Side Finish() const {
    Side side;
    const float share = 1 / static_cast<float>(std::max(1, count_));
    for (int k = 0; k < kNumValues; ++k) {
      side.mean[k] = sum_[k] * share;
      const float variance = std::max(0.0f, squares_[k] * share - side.mean[k] * side.mean[k]);
      (k < kFeatureSize ? side.feature_variance : side.color_variance) += variance;
    }
    return side;
  }

 private:
  int count_ = 0;
  Values sum_{}, squares_{};
};

// Returns how much more `at` resembles the inside than the outside, in units of their variances.
float Evidence(const Values& at, const Side& inside, const Side& outside) {
  const auto compare = [&](int first, int count, float variance) {
    const float* values = &at[first];
    return (SquaredDistance(values, &outside.mean[first], count) -
            SquaredDistance(values, &inside.mean[first], count)) /
           variance;
  };
  return compare(0, kFeatureSize,
                 inside.feature_variance + outside.feature_variance + kFeatureNoise) +
         kColorWeight *
             compare(kFeatureSize, 3, inside.color_variance + outside.color_variance + kColorNoise);
}

class BorderRefiner {
 public:
  BorderRefiner(const BorderPixels& pixels, std::span<const uint8_t> mask)
      : pixels_(pixels), places_(PlacesOf(mask)), slot_(mask.size(), -1) {}

  void WriteTo(std::span<uint8_t> mask) {
    for (int y = 0; y < pixels_.height; ++y) {
      for (int x = 0; x < pixels_.width; ++x) {
        const size_t i = IndexOf(x, y);
        if (!IsBorder(places_[i])) continue;
        if (std::abs(double{pixels_.similarity[i]} - pixels_.threshold) >= kUncertain) continue;
        mask[i] = IsInsideNow(x, y) ? 1 : 0;
      }
    }
  }

 private:
  size_t IndexOf(int x, int y) const { return static_cast<size_t>(y) * pixels_.width + x; }

  // Calls `use` with the index of each pixel of the window around a pixel.
  template <typename Use>
  void ForWindow(int x, int y, Use use) const {
    const int x1 = std::min(pixels_.width - 1, x + kRadius);
    const int y1 = std::min(pixels_.height - 1, y + kRadius);
    for (int j = std::max(0, y - kRadius); j <= y1; ++j) {
      for (int i = std::max(0, x - kRadius); i <= x1; ++i) use(IndexOf(i, j));
    }
  }

  // Compares each pixel with four of its neighbours, so that each pair is compared once.
  std::vector<Place> PlacesOf(std::span<const uint8_t> mask) const {
    std::vector<Place> places(mask.size());
    for (size_t i = 0; i < mask.size(); ++i) places[i] = mask[i] != 0 ? kDeepInside : kDeepOutside;
    const auto compare = [&](size_t a, size_t b) {
      if (mask[a] == mask[b]) return;
      places[a] = mask[a] != 0 ? kBorderInside : kBorderOutside;
      places[b] = mask[b] != 0 ? kBorderInside : kBorderOutside;
    };
    for (int y = 0; y < pixels_.height; ++y) {
      for (int x = 0; x < pixels_.width; ++x) {
        const size_t i = IndexOf(x, y);
        const bool has_right = x + 1 < pixels_.width;
        if (has_right) compare(i, i + 1);
        if (y + 1 == pixels_.height) continue;
        compare(i, i + pixels_.width);
        if (has_right) compare(i, i + pixels_.width + 1);
        if (x > 0) compare(i, i + pixels_.width - 1);
      }
    }
    return places;
  }

  // Returns the values of a pixel, converted when they are first needed: few pixels are near a
  // border. Valid until the next call.
  const Values& ValuesOf(size_t i) {
    if (slot_[i] < 0) {
      slot_[i] = static_cast<int32_t>(values_.size());
      Values& values = values_.emplace_back();
      for (int k = 0; k < kFeatureSize; ++k) {
        values[k] = FloatFromHalf(pixels_.features[i * kFeatureSize + k]) * pixels_.psi[k];
      }
      for (int k = 0; k < 3; ++k) {
        values[kFeatureSize + k] = static_cast<float>(pixels_.rgb[3 * i + k]) / 255;
      }
    }
    return values_[slot_[i]];
  }

  // Describes a side by its deep pixels in the window or, of a thing too thin to have any, by all.
  Side SideAt(int x, int y, bool inside) {
    SideSum deep, all;
    ForWindow(x, y, [&](size_t i) {
      if (IsInside(places_[i]) == inside && !IsBorder(places_[i])) deep.Add(ValuesOf(i));
    });
    if (deep.count() > 0) return deep.Finish();
    ForWindow(x, y, [&](size_t i) {
      if (IsInside(places_[i]) == inside) all.Add(ValuesOf(i));
    });
    return all.Finish();
  }

  bool IsInsideNow(int x, int y) {
    const Side inside = SideAt(x, y, true), outside = SideAt(x, y, false);
    const size_t i = IndexOf(x, y);
    const float stay = IsInside(places_[i]) ? kClear : -kClear;
    return Evidence(ValuesOf(i), inside, outside) + stay > 0;
  }

  const BorderPixels& pixels_;
  const std::vector<Place> places_;
  std::vector<int32_t> slot_;   // index into values_, -1: not yet converted
  std::vector<Values> values_;  // of pixels near a border
};

}  // namespace

void RefineBorder(const BorderPixels& pixels, std::span<uint8_t> mask) {
  BorderRefiner(pixels, mask).WriteTo(mask);
}

}  // namespace pepeseg
