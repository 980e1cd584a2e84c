#include <gtest/gtest.h>

#include <cmath>

#include "tests/kernels/feature_map_test.h"
#include "tests/kernels/test_scene.h"

// SegmentPixels against a mask computed on the host from Similarity.

namespace pepeseg {
namespace {

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

}  // namespace
}  // namespace pepeseg
