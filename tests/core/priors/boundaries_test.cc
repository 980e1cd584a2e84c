#include "core/priors/boundaries.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

namespace pepeseg {
namespace {

constexpr int kWidth = 40, kHeight = 30;

// A view with the depth prior `prior` and no photograph.
View WithPrior(const std::function<float(int x, int y)>& prior) {
  View view;
  view.camera = {kWidth, kHeight, 40, 40, 20, 15};
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) view.depth.values.push_back(prior(x, y));
  }
  return view;
}

TEST(DepthEdges, MarkABandAroundAStep) {
  const std::vector<uint8_t> edges =
      DepthEdges(WithPrior([](int x, int) { return x < 20 ? 0.3f : 0.5f; }));
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const bool near = x >= 18 && x <= 21, far = x < 16 || x > 23;
      if (near || far) {
        ASSERT_EQ(edges[y * kWidth + x], near ? 1 : 0) << x << ", " << y;
      }
    }
  }
}

TEST(DepthEdges, MarkNothingOnASlope) {
  const std::vector<uint8_t> edges =
      DepthEdges(WithPrior([](int x, int y) { return 0.01f * x + 0.005f * y; }));
  for (const uint8_t edge : edges) ASSERT_EQ(edge, 0);
}

TEST(DepthEdges, MarkUnknownPixels) {
  const std::vector<uint8_t> edges =
      DepthEdges(WithPrior([](int x, int y) { return x == 3 && y == 4 ? NAN : 0.0f; }));
  for (int i = 0; i < kWidth * kHeight; ++i) ASSERT_EQ(edges[i], i == 4 * kWidth + 3 ? 1 : 0);
}

}  // namespace
}  // namespace pepeseg
