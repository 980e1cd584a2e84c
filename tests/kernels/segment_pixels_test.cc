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

class SegmentPixelsTest : public BackendTest {
 protected:
  void SetUp() override {
    BackendTest::SetUp();
    if (IsSkipped()) return;
    std::vector<Half> map;
    for (float f : RandomValues(kPixels * kSize, 1)) map.push_back(HalfFromFloat(f));
    std::fill_n(map.begin() + kSize, kSize, Half{0});  // pixel 1: nothing was blended
    map_ = Buffer<Half>(*backend_, std::span<const Half>(map));
    std::vector<float> psi = RandomValues(kSize, 3);
    for (float& value : psi) value = std::abs(value);
    psi_ = Upload(*backend_, psi);
  }

  // What Similarity says, put together on the host.
  struct Want {
    std::vector<uint8_t> mask;
    std::vector<float> similarity;
    int64_t inside = 0, sum = 0;
  };
  Want FromSimilarity(const Buffer<float>& queries, int num_positive, float threshold) {
    const auto num_queries = static_cast<int>(queries.size() / kSize);
    Buffer<float> similarity(*backend_, int64_t{kPixels} * num_queries);
    backend_->Similarity({map_.span(), psi_.span(), queries.span(), kMinNorm, similarity.span()});
    const std::vector<float> all = Download(similarity);
    Want want;
    for (int p = 0; p < kPixels; ++p) {
      float best[2] = {-std::numeric_limits<float>::infinity(),
                       -std::numeric_limits<float>::infinity()};
      for (int q = 0; q < num_queries; ++q) {
        float& of_kind = best[q < num_positive ? 0 : 1];
        of_kind = std::max(of_kind, all[q * kPixels + p]);
      }
      const bool inside = best[0] > threshold && best[0] > best[1];
      want.mask.push_back(inside ? 1 : 0);
      want.similarity.push_back(best[0]);
      want.inside += inside ? 1 : 0;
      want.sum += inside ? std::lrintf(best[0] * kSimilarityUnit) : 0;
    }
    return want;
  }

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

  Buffer<Half> map_;
  Buffer<float> psi_;
};
INSTANTIATE_TEST_SUITE_P(Backends, SegmentPixelsTest, AllBackends(), BackendName);

TEST_P(SegmentPixelsTest, IsTheMaskThatSimilarityGives) {
  ExpectAsSimilarity(1, 1, 0.1f);
  ExpectAsSimilarity(5, 3, 0.05f);
  ExpectAsSimilarity(kMaxQueries, 100, 0.3f);
  ExpectAsSimilarity(2, 1, -0.2f);  // negative similarities are added up, too
}

TEST_P(SegmentPixelsTest, SimilaritiesNeedNotBeKept) {
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
