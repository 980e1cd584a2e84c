#include <gtest/gtest.h>

#include <algorithm>

#include "tests/kernels/feature_map_test.h"
#include "tests/kernels/test_scene.h"

// LevelOverlaps against levels and counts computed on the host from Similarity.

namespace pepeseg {
namespace {

class LevelOverlapsTest : public FeatureMapTest {
 protected:
  // Computes the levels on the host from the result of Similarity at each scale.
  std::vector<uint8_t> Levels(const Buffer<float>& psi, const Buffer<float>& queries,
                              int num_positive, std::span<const float> thresholds) {
    std::vector<uint8_t> levels;
    for (int64_t scale = 0; scale < psi.size() / kSize; ++scale) {
      const DeviceSpan<const float> of_scale = psi.span().Subspan(scale * kSize, kSize);
      for (const Best& best : BestSimilarities(of_scale, queries, num_positive)) {
        const auto level =
            std::count_if(thresholds.begin(), thresholds.end(),
                          [&](float threshold) { return best.positive > threshold; });
        levels.push_back(best.positive > best.negative ? static_cast<uint8_t>(level) : 0);
      }
    }
    return levels;
  }

  // Runs the op and compares levels and overlaps with those counted on the host.
  void ExpectCounts(int num_scales, int num_queries, int num_positive,
                    const std::vector<float>& thresholds) {
    const Buffer<float> psi = Gates(num_scales);
    const Buffer<float> queries = Upload(*backend_, RandomValues(num_queries * kSize, 2));
    const Buffer<float> over = Upload(*backend_, thresholds);
    const int side = static_cast<int>(thresholds.size()) + 1;
    Buffer<uint8_t> levels(*backend_, int64_t{kPixels} * num_scales);
    Buffer<int32_t> overlaps(*backend_, int64_t{num_scales} * num_scales * side * side);
    backend_->LevelOverlaps({.map = map_.span(),
                             .psi = psi.span(),
                             .queries = queries.span(),
                             .num_positive = num_positive,
                             .thresholds = over.span(),
                             .min_norm = kMinNorm,
                             .levels = levels.span(),
                             .overlaps = overlaps.span()});
    const std::vector<uint8_t> want = Levels(psi, queries, num_positive, thresholds);
    EXPECT_EQ(Download(levels), want);
    EXPECT_GT(*std::max_element(want.begin(), want.end()), 0);
    std::vector<int32_t> counts(overlaps.size());
    for (int a = 0; a < num_scales; ++a) {
      for (int b = a; b < num_scales; ++b) {
        for (int p = 0; p < kPixels; ++p) {
          const int i = want[a * kPixels + p], j = want[b * kPixels + p];
          if (i + j > 0) ++counts[((a * num_scales + b) * side + i) * side + j];
        }
      }
    }
    EXPECT_EQ(Download(overlaps), counts);
  }
};
INSTANTIATE_TEST_SUITE_P(Backends, LevelOverlapsTest, AllBackends(), BackendName);

TEST_P(LevelOverlapsTest, CountsThePixelsOfEachPairOfLevels) {
  ExpectCounts(1, 1, 1, {0.1f});
  ExpectCounts(5, 3, 2, {-0.1f, 0.0f, 0.1f, 0.2f, 0.3f});
}

TEST_P(LevelOverlapsTest, AcceptsTheMostScalesThresholdsAndQueries) {
  std::vector<float> thresholds;
  thresholds.reserve(kMaxThresholds);
  for (int t = 0; t < kMaxThresholds; ++t) thresholds.push_back(0.02f * static_cast<float>(t));
  ExpectCounts(kMaxLevelScales, kMaxQueries, 100, thresholds);
}

}  // namespace
}  // namespace pepeseg
