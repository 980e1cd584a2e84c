#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "kernels/half.h"
#include "tests/kernels/backend_test.h"
#include "tests/kernels/test_scene.h"

// Queries on a cached feature map: Similarity against cosines in double; SegmentPixels and
// LevelOverlaps against masks, levels and counts computed on the host from Similarity.

namespace pepeseg {
namespace {

constexpr int kSize = kFeatureSize;

class SimilarityTest : public BackendTest {};
INSTANTIATE_TEST_SUITE_P(Backends, SimilarityTest, AllBackends(), BackendName);

TEST_P(SimilarityTest, IsTheCosineOfGatedFeatures) {
  constexpr int kPixels = 37, kQueries = 3;
  std::vector<float> features = RandomValues(kPixels * kSize, 1);
  std::fill_n(features.begin() + kSize, kSize, 0.0f);                // pixel 1: nothing is blended
  for (int k = 0; k < kSize; ++k) features[2 * kSize + k] *= 1e-3f;  // pixel 2: little is blended
  const std::vector<float> queries = RandomValues(kQueries * kSize, 2);
  std::vector<float> psi = RandomValues(kSize, 3);
  for (float& value : psi) value = std::abs(value);
  // The expected values are of the features as rounded to half.
  std::vector<Half> map;
  for (float& f : features) {
    map.push_back(HalfFromFloat(f));
    f = FloatFromHalf(map.back());
  }
  const Buffer<Half> map_buffer(*backend_, std::span<const Half>(map));
  const Buffer<float> psi_buffer = Upload(*backend_, psi), query = Upload(*backend_, queries);
  Buffer<float> similarity(*backend_, kPixels * kQueries);
  backend_->Similarity(
      {map_buffer.span(), psi_buffer.span(), query.span(), 0.1f, similarity.span()});
  const std::vector<float> got = Download(similarity);
  for (int q = 0; q < kQueries; ++q) {
    for (int p = 0; p < kPixels; ++p) {
      double ab = 0, aa = 0, bb = 0;
      for (int k = 0; k < kSize; ++k) {
        const double a = double{psi[k]} * features[p * kSize + k];
        const double b = double{psi[k]} * queries[q * kSize + k];
        ab += a * b;
        aa += a * a;
        bb += b * b;
      }
      // Pixels 1 and 2 are under the smallest norm.
      const double want = p == 1 || p == 2 ? 0 : ab / std::sqrt(aa * bb);
      EXPECT_NEAR(got[q * kPixels + p], want, 1e-5);
    }
  }
}

// Base of the tests of SegmentPixels and LevelOverlaps.
class FeatureMapTest : public BackendTest {
 protected:
  static constexpr int kPixels = 5003;  // not a multiple of a block or a task
  static constexpr float kMinNorm = 0.4f;

  void SetUp() override;

  // Returns random gates at some scales, [num_scales, 32], on the backend.
  Buffer<float> Gates(int num_scales);

  // The largest similarity of a pixel to the positive and to the negative queries.
  struct Best {
    float positive, negative;
  };
  // Computes them on the host from the result of Similarity. psi is [32].
  std::vector<Best> BestSimilarities(DeviceSpan<const float> psi, const Buffer<float>& queries,
                                     int num_positive);

  Buffer<Half> map_;  // [kPixels, 32]; on pixel 1 nothing was blended
};

void FeatureMapTest::SetUp() {
  BackendTest::SetUp();
  if (IsSkipped()) return;
  std::vector<Half> map;
  map.reserve(kPixels * kSize);
  for (float f : RandomValues(kPixels * kSize, 1)) map.push_back(HalfFromFloat(f));
  // Pixel 1 has no feature.
  std::fill_n(map.begin() + kSize, kSize, Half{0});
  map_ = Buffer<Half>(*backend_, std::span<const Half>(map));
}

Buffer<float> FeatureMapTest::Gates(int num_scales) {
  std::vector<float> psi = RandomValues(num_scales * kSize, 3);
  // Gates are positive.
  for (float& value : psi) value = std::abs(value);
  return Upload(*backend_, psi);
}

std::vector<FeatureMapTest::Best> FeatureMapTest::BestSimilarities(DeviceSpan<const float> psi,
                                                                   const Buffer<float>& queries,
                                                                   int num_positive) {
  const auto num_queries = static_cast<int>(queries.size() / kSize);
  Buffer<float> similarity(*backend_, int64_t{kPixels} * num_queries);
  backend_->Similarity({map_.span(), psi, queries.span(), kMinNorm, similarity.span()});
  const std::vector<float> all = Download(similarity);
  constexpr float kNever = -std::numeric_limits<float>::infinity();
  std::vector<Best> best(kPixels, {kNever, kNever});
  for (int q = 0; q < num_queries; ++q) {
    for (int p = 0; p < kPixels; ++p) {
      float& of_kind = q < num_positive ? best[p].positive : best[p].negative;
      of_kind = std::max(of_kind, all[q * kPixels + p]);
    }
  }
  return best;
}

class SegmentPixelsTest : public FeatureMapTest {
 protected:
  void SetUp() override {
    FeatureMapTest::SetUp();
    if (!IsSkipped()) psi_ = Gates(1);
  }

  // Mask and sums computed on the host from the result of Similarity.
  struct Want {
    std::vector<uint8_t> mask;
    std::vector<float> similarity;
    int64_t inside = 0, sum = 0;
  };
  Want FromSimilarity(const Buffer<float>& queries, int num_positive, float threshold) {
    Want want;
    for (const Best& best : BestSimilarities(psi_.span(), queries, num_positive)) {
      const bool inside = best.positive > threshold && best.positive > best.negative;
      want.mask.push_back(inside ? 1 : 0);
      want.similarity.push_back(best.positive);
      want.inside += inside ? 1 : 0;
      want.sum += inside ? std::lrintf(best.positive * kSimilarityUnit) : 0;
    }
    return want;
  }

  // Runs the op and compares it with them.
  void ExpectAsSimilarity(int num_queries, int num_positive, float threshold) {
    const Buffer<float> queries = Upload(*backend_, RandomValues(num_queries * kSize, 2));
    const Want want = FromSimilarity(queries, num_positive, threshold);
    Buffer<uint8_t> mask(*backend_, kPixels);
    Buffer<float> similarity(*backend_, kPixels);
    Buffer<int64_t> sums(*backend_, kNumSegmentSums);
    backend_->SegmentPixels({.map = map_.span(),
                             .psi = psi_.span(),
                             .queries = queries.span(),
                             .num_positive = num_positive,
                             .min_norm = kMinNorm,
                             .threshold = threshold,
                             .mask = mask.span(),
                             .similarity = similarity.span(),
                             .sums = sums.span()});
    EXPECT_EQ(Download(mask), want.mask);
    EXPECT_EQ(Download(similarity), want.similarity);
    const std::vector<int64_t> got = Download(sums);
    EXPECT_EQ(got[kNumInside], want.inside);
    EXPECT_EQ(got[kSimilaritySum], want.sum);
    EXPECT_GT(want.inside, 0);
    EXPECT_LT(want.inside, kPixels);
  }

  Buffer<float> psi_;
};
INSTANTIATE_TEST_SUITE_P(Backends, SegmentPixelsTest, AllBackends(), BackendName);

TEST_P(SegmentPixelsTest, GivesTheMaskOfTheSimilarities) {
  ExpectAsSimilarity(1, 1, 0.1f);
  ExpectAsSimilarity(5, 3, 0.05f);
  ExpectAsSimilarity(kMaxQueries, 100, 0.3f);
  ExpectAsSimilarity(2, 1, -0.2f);  // negative similarities count in the sum, too
}

TEST_P(SegmentPixelsTest, WorksWithoutKeepingSimilarities) {
  const Buffer<float> queries = Upload(*backend_, RandomValues(2 * kSize, 2));
  const Want want = FromSimilarity(queries, 1, 0.1f);
  Buffer<uint8_t> mask(*backend_, kPixels);
  Buffer<int64_t> sums(*backend_, kNumSegmentSums);
  backend_->SegmentPixels({.map = map_.span(),
                           .psi = psi_.span(),
                           .queries = queries.span(),
                           .min_norm = kMinNorm,
                           .threshold = 0.1f,
                           .mask = mask.span(),
                           .sums = sums.span()});
  EXPECT_EQ(Download(mask), want.mask);
}

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

class PackMaskTest : public BackendTest {};
INSTANTIATE_TEST_SUITE_P(Backends, PackMaskTest, AllBackends(), BackendName);

TEST_P(PackMaskTest, HasABitForEachPixelAndZerosAfterTheLast) {
  for (const int num_pixels : {1, 31, 32, 33, 500, 1'000}) {
    const std::vector<float> values = RandomValues(num_pixels, 7);
    std::vector<uint8_t> mask(values.size());
    std::vector<uint32_t> want(static_cast<size_t>(NumMaskWords(num_pixels)));
    for (size_t i = 0; i < mask.size(); ++i) {
      mask[i] = values[i] > 0.1f ? 1 : 0;
      want[i / 32] |= uint32_t{mask[i]} << (i % 32);
    }
    const Buffer<uint8_t> pixels(*backend_, std::span<const uint8_t>(mask));
    const std::vector<uint32_t> ones(want.size(), ~0u);  // all of them must be written
    Buffer<uint32_t> bits(*backend_, std::span<const uint32_t>(ones));
    backend_->PackMask({pixels.span(), bits.span()});
    EXPECT_EQ(Download(bits), want) << num_pixels;
  }
}

}  // namespace
}  // namespace pepeseg
