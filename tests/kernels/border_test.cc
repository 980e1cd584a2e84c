#include "kernels/math/border.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "kernels/half.h"
#include "kernels/ops/similarity.h"
#include "tests/kernels/backend_test.h"
#include "tests/kernels/test_scene.h"

namespace pepeseg {
namespace {

// A view for RefineBorder on the host.
struct BorderView {
  BorderView(int w, int h)
      : width(w),
        height(h),
        features(Count() * kFeatureSize),
        color(Count() * 3),
        similarity(Count()),
        mask(Count()) {}

  size_t Count() const { return static_cast<size_t>(width) * height; }
  size_t At(int x, int y) const { return static_cast<size_t>(y) * width + x; }
  float Color(size_t pixel, int channel) const { return color[channel * Count() + pixel]; }

  // Returns the refined mask, and checks that its sums were computed.
  std::vector<uint8_t> Refine(Backend& backend) const {
    const Buffer<Half> map(backend, std::span<const Half>(features));
    const Buffer<float> colors = Upload(backend, color),
                        psis = Upload(backend, {psi.begin(), psi.end()});
    const Buffer<float> similarities = Upload(backend, similarity);
    const Buffer<uint8_t> before(backend, std::span<const uint8_t>(mask));
    const std::vector<int64_t> sums_before = SumsOf(mask);
    Buffer<int64_t> sums(backend, std::span<const int64_t>(sums_before));
    Buffer<uint8_t> refined(backend, before.size());
    backend.RefineBorder({.width = width,
                          .height = height,
                          .map = map.span(),
                          .color = colors.span(),
                          .psi = psis.span(),
                          .similarity = similarities.span(),
                          .threshold = threshold,
                          .mask = before.span(),
                          .refined = refined.span(),
                          .sums = sums.span()});
    std::vector<uint8_t> after(mask.size());
    refined.Download(std::span<uint8_t>(after));
    std::vector<int64_t> sums_after(kNumSegmentSums);
    sums.Download(std::span<int64_t>(sums_after));
    EXPECT_EQ(sums_after, SumsOf(after));
    return after;
  }

  std::vector<int64_t> SumsOf(const std::vector<uint8_t>& of) const {
    std::vector<int64_t> sums(kNumSegmentSums);
    for (size_t i = 0; i < of.size(); ++i) {
      if (of[i] == 0) continue;
      ++sums[kNumInside];
      sums[kSimilaritySum] += std::lrint(similarity[i] * kSimilarityUnit);
    }
    return sums;
  }

  int width, height;
  std::vector<Half> features;
  std::vector<float> color;  // [3, height, width]
  std::vector<float> similarity;
  float threshold = 0.75f;
  std::array<float, kFeatureSize> psi{};
  std::vector<uint8_t> mask;
};

constexpr int kWidth = 12, kHeight = 9;

// Two things with orthogonal features and different colours, side by side. `share` of the left one
// is in each column; the query is for the left one.
class BorderTest : public BackendTest {
 protected:
  BorderTest() { view_.psi.fill(1); }

  // Gives a pixel `share` of the left thing's feature, and as much of its colour.
  void Mix(int x, int y, double share) {
    const size_t i = view_.At(x, y);
    view_.features[i * kFeatureSize] = HalfFromFloat(static_cast<float>(share));
    view_.features[i * kFeatureSize + 1] = HalfFromFloat(static_cast<float>(1 - share));
    view_.similarity[i] = static_cast<float>(share / std::hypot(share, 1 - share));
    Paint(x, y, share);
  }
  void Paint(int x, int y, double share) {
    const size_t i = view_.At(x, y);
    view_.color[i] = static_cast<float>(0.8 * share);
    view_.color[2 * view_.Count() + i] = static_cast<float>(0.8 * (1 - share));
  }
  void MixColumn(int x, double share) {
    for (int y = 0; y < kHeight; ++y) Mix(x, y, share);
  }
  // Columns left of `border` show the left thing.
  void Split(int border) {
    for (int x = 0; x < kWidth; ++x) MixColumn(x, x < border ? 1 : 0);
  }
  void Mark(int x, uint8_t value) {
    for (int y = 0; y < kHeight; ++y) view_.mask[view_.At(x, y)] = value;
  }
  // Marks all columns left of `border` as inside.
  void MarkUntil(int border) {
    for (int x = 0; x < kWidth; ++x) Mark(x, x < border ? 1 : 0);
  }
  // Returns the number of columns inside at the left of each row of the refined mask, which must be
  // the same in all.
  int Border() const {
    const std::vector<uint8_t> mask = view_.Refine(*backend_);
    std::vector<int> counts;
    for (int y = 0; y < kHeight; ++y) {
      const uint8_t* row = &mask[view_.At(0, y)];
      int count = 0;
      while (count < kWidth && row[count] != 0) ++count;
      EXPECT_EQ(std::count(row, row + kWidth, 1), count) << "row " << y;
      counts.push_back(count);
    }
    EXPECT_EQ(std::count(counts.begin(), counts.end(), counts[0]), kHeight);
    return counts[0];
  }

  BorderView view_ = {kWidth, kHeight};
};
INSTANTIATE_TEST_SUITE_P(Backends, BorderTest, AllBackends(), BackendName);

TEST_P(BorderTest, AddsAPixelThatIsMostlyInside) {
  Split(6);
  MixColumn(6, 0.7);  // similarity 0.92
  MarkUntil(6);
  view_.threshold = 0.95f;
  EXPECT_EQ(Border(), 7);
}

TEST_P(BorderTest, RemovesAPixelThatIsMostlyOutside) {
  Split(6);
  MixColumn(6, 0.3);  // similarity 0.39
  MarkUntil(7);
  view_.threshold = 0.35f;
  EXPECT_EQ(Border(), 6);
}

TEST_P(BorderTest, KeepsAPixelThatIsHalfInside) {
  Split(6);
  MixColumn(6, 0.5);
  for (const int border : {6, 7}) {
    MarkUntil(border);
    EXPECT_EQ(Border(), border);
  }
}

TEST_P(BorderTest, KeepsPixelsWhoseSimilarityIsFarFromTheThreshold) {
  Split(6);
  MixColumn(6, 0.3);
  MarkUntil(7);
  view_.threshold = 0.25f;  // 0.14 away
  EXPECT_EQ(Border(), 7);
}

TEST_P(BorderTest, FollowsColourWhereFeaturesAreEqual) {
  for (int x = 0; x < kWidth; ++x) MixColumn(x, 1);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) Paint(x, y, x < 6 ? 1 : 0);
  }
  view_.threshold = 0.95f;
  MarkUntil(7);
  EXPECT_EQ(Border(), 6);
}

TEST_P(BorderTest, KeepsABorderThatNothingShows) {
  for (int x = 0; x < kWidth; ++x) MixColumn(x, 1);
  view_.threshold = 0.95f;
  MarkUntil(7);
  EXPECT_EQ(Border(), 7);
}

TEST_P(BorderTest, GatesFeatures) {
  Split(6);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) Paint(x, y, 1);
  }
  MarkUntil(7);
  std::ranges::fill(view_.similarity, 0.75f);
  BorderView closed = view_;
  closed.psi = {};  // no feature passes
  EXPECT_EQ(closed.Refine(*backend_), view_.mask);
  EXPECT_EQ(Border(), 6);
}

// A column of one pixel has no pixel away from its border.
TEST_P(BorderTest, KeepsThinThings) {
  Split(0);
  MixColumn(5, 1);
  view_.threshold = 0.95f;
  Mark(5, 1);
  EXPECT_EQ(view_.Refine(*backend_), view_.mask);
}

TEST_P(BorderTest, LeavesAFullAndAnEmptyMask) {
  Split(6);
  std::ranges::fill(view_.similarity, 0.75f);
  for (const uint8_t value : {0, 1}) {
    std::ranges::fill(view_.mask, value);
    EXPECT_EQ(view_.Refine(*backend_), view_.mask);
  }
}

// Random features, colours and masks, of more than one band of rows on the CPU.
class RandomBorderTest : public BackendTest {
 protected:
  RandomBorderTest() {
    const auto fill = [](std::vector<float>& values, uint32_t seed) {
      values = RandomValues(static_cast<int>(values.size()), seed);
    };
    // Blocks of 6 x 6 pixels share most of their features. The mask is one pixel off the blocks.
    std::vector<float> own(view_.features.size()), of_block(own.size());
    fill(own, 1);
    fill(of_block, 2);
    fill(view_.color, 3);
    fill(view_.similarity, 4);
    for (int y = 0; y < view_.height; ++y) {
      for (int x = 0; x < view_.width; ++x) {
        const size_t i = view_.At(x, y);
        const size_t block = view_.At(x / 6, y / 6);
        for (int k = 0; k < kFeatureSize; ++k) {
          view_.features[i * kFeatureSize + k] = HalfFromFloat(
              0.2f * own[i * kFeatureSize + k] + 0.5f * of_block[block * kFeatureSize + k]);
        }
        view_.similarity[i] = view_.threshold + 0.15f * view_.similarity[i];
        view_.mask[i] = ((x + 1) / 6 + y / 6) % 3 == 0 ? 1 : 0;
      }
    }
    for (int k = 0; k < kFeatureSize; ++k) view_.psi[k] = 0.1f + 0.02f * static_cast<float>(k);
  }

  // Calls `use` with each pixel of the image at most `radius` away.
  template <typename Use>
  void Around(int x, int y, int radius, Use use) const {
    for (int j = std::max(0, y - radius); j <= std::min(view_.height - 1, y + radius); ++j) {
      for (int i = std::max(0, x - radius); i <= std::min(view_.width - 1, x + radius); ++i) {
        use(i, j);
      }
    }
  }
  bool IsBorder(int x, int y) const {
    bool found = false;
    Around(x, y, 1, [&](int i, int j) {
      found |= view_.mask[view_.At(i, j)] != view_.mask[view_.At(x, y)];
    });
    return found;
  }
  bool IsOpen(int x, int y) const {
    const float away = view_.similarity[view_.At(x, y)] - view_.threshold;
    return std::abs(away) < kBorderUncertain && IsBorder(x, y);
  }

  using Values = std::array<double, kFeatureSize + 3>;
  Values ValuesOf(int x, int y) const {
    const size_t i = view_.At(x, y);
    Values values;
    for (int k = 0; k < kFeatureSize; ++k) {
      values[k] = double{view_.psi[k]} * FloatFromHalf(view_.features[i * kFeatureSize + k]);
    }
    for (int k = 0; k < 3; ++k) {
      values[kFeatureSize + k] = std::clamp(double{view_.Color(i, k)}, 0.0, 1.0);
    }
    return values;
  }
  // Returns the sum that decides a pixel, in double: inside if it is above 0.
  double Decision(int x, int y) const;

  BorderView view_ = {71, 45};
};
INSTANTIATE_TEST_SUITE_P(Backends, RandomBorderTest, AllBackends(), BackendName);

// METHOD.md section 4, "Borders".
double RandomBorderTest::Decision(int x, int y) const {
  std::array<Values, 2> mean{};
  std::array<std::array<double, 2>, 2> variance{};  // [side][feature, colour]
  for (const int side : {0, 1}) {
    std::vector<Values> deep, all;
    Around(x, y, 2, [&](int i, int j) {
      if (view_.mask[view_.At(i, j)] != side) return;
      all.push_back(ValuesOf(i, j));
      if (!IsBorder(i, j)) deep.push_back(all.back());
    });
    const std::vector<Values>& pixels = deep.empty() ? all : deep;
    const auto count = static_cast<double>(pixels.size());
    for (size_t k = 0; k < mean[side].size(); ++k) {
      for (const Values& values : pixels) mean[side][k] += values[k] / count;
      for (const Values& values : pixels) {
        variance[side][k < kFeatureSize ? 0 : 1] += std::pow(values[k] - mean[side][k], 2) / count;
      }
    }
  }
  const Values at = ValuesOf(x, y);
  std::array<double, 2> nearer{};
  for (size_t k = 0; k < at.size(); ++k) {
    nearer[k < kFeatureSize ? 0 : 1] +=
        std::pow(at[k] - mean[0][k], 2) - std::pow(at[k] - mean[1][k], 2);
  }
  return nearer[0] / (variance[0][0] + variance[1][0] + 0.01) +
         0.3 * nearer[1] / (variance[0][1] + variance[1][1] + 0.001) +
         (view_.mask[view_.At(x, y)] != 0 ? 1 : -1);
}

TEST_P(RandomBorderTest, FollowsTheFormulaInDouble) {
  const std::vector<uint8_t> refined = view_.Refine(*backend_);
  int num_open = 0, num_moved = 0;
  for (int y = 0; y < view_.height; ++y) {
    for (int x = 0; x < view_.width; ++x) {
      const size_t i = view_.At(x, y);
      const bool moved = refined[i] != view_.mask[i];
      if (!IsOpen(x, y)) {
        EXPECT_FALSE(moved) << x << ", " << y;
        continue;
      }
      ++num_open;
      num_moved += moved ? 1 : 0;
      const double decision = Decision(x, y);
      if (std::abs(decision) < 1e-4) continue;  // rounding may decide
      EXPECT_EQ(refined[i], decision > 0 ? 1 : 0) << x << ", " << y << ": " << decision;
    }
  }
  EXPECT_GT(num_open, 300);
  EXPECT_GT(num_moved, 50);
}

}  // namespace
}  // namespace pepeseg
