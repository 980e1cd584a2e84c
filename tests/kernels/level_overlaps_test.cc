#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "kernels/cpu/half.h"
#include "tests/kernels/backend_test.h"
#include "tests/kernels/test_scene.h"

namespace pepeseg {
namespace {

constexpr int kSize = kFeatureSize;
constexpr int kPixels = 5003;  // no multiple of a block or a task
constexpr float kMinNorm = 0.4f;

class LevelOverlapsTest : public BackendTest {
 protected:
  void SetUp() override {
    BackendTest::SetUp();
    if (IsSkipped()) return;
    std::vector<Half> map;
    map.reserve(kPixels * kSize);
    for (float f : RandomValues(kPixels * kSize, 1)) map.push_back(HalfFromFloat(f));
    std::fill_n(map.begin() + kSize, kSize, Half{0});  // pixel 1: nothing was blended
    map_ = Buffer<Half>(*backend_, std::span<const Half>(map));
  }

  // Levels put together on the host from what Similarity says at each scale.
  std::vector<uint8_t> Levels(const Buffer<float>& psi, const Buffer<float>& queries,
                              int num_positive, std::span<const float> thresholds) {
    const auto num_queries = static_cast<int>(queries.size() / kSize);
    std::vector<uint8_t> levels;
    for (int64_t scale = 0; scale < psi.size() / kSize; ++scale) {
      Buffer<float> similarity(*backend_, int64_t{kPixels} * num_queries);
      backend_->Similarity({map_.span(), psi.span().Subspan(scale * kSize, kSize), queries.span(),
                            kMinNorm, similarity.span()});
      const std::vector<float> all = Download(similarity);
      for (int p = 0; p < kPixels; ++p) {
        constexpr float kNever = -std::numeric_limits<float>::infinity();
        float best[2] = {kNever, kNever};
        for (int q = 0; q < num_queries; ++q) {
          float& of_kind = best[q < num_positive ? 0 : 1];
          of_kind = std::max(of_kind, all[q * kPixels + p]);
        }
        const auto level = std::count_if(thresholds.begin(), thresholds.end(),
                                         [&](float threshold) { return best[0] > threshold; });
        levels.push_back(best[0] > best[1] ? static_cast<uint8_t>(level) : 0);
      }
    }
    return levels;
  }

  void ExpectCounts(int num_scales, int num_queries, int num_positive,
                    const std::vector<float>& thresholds) {
    std::vector<float> gates = RandomValues(num_scales * kSize, 3);
    for (float& value : gates) value = std::abs(value);
    const Buffer<float> psi = Upload(*backend_, gates);
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

  Buffer<Half> map_;
};
INSTANTIATE_TEST_SUITE_P(Backends, LevelOverlapsTest, AllBackends(), BackendName);

TEST_P(LevelOverlapsTest, CountsThePixelsOfEachPairOfLevels) {
  ExpectCounts(1, 1, 1, {0.1f});
  ExpectCounts(5, 3, 2, {-0.1f, 0.0f, 0.1f, 0.2f, 0.3f});
}

TEST_P(LevelOverlapsTest, AsManyScalesThresholdsAndQueriesAsThereMayBe) {
  std::vector<float> thresholds;
  thresholds.reserve(kMaxThresholds);
  for (int t = 0; t < kMaxThresholds; ++t) thresholds.push_back(0.02f * static_cast<float>(t));
  ExpectCounts(kMaxLevelScales, kMaxQueries, 100, thresholds);
}

}  // namespace
}  // namespace pepeseg
