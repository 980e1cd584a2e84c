#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "kernels/half.h"
#include "tests/kernels/backend_test.h"
#include "tests/kernels/test_scene.h"

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

}  // namespace
}  // namespace pepeseg
