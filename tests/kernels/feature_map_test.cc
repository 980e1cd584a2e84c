#include "tests/kernels/feature_map_test.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "kernels/half.h"
#include "tests/kernels/test_scene.h"

namespace pepeseg {

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

}  // namespace pepeseg
