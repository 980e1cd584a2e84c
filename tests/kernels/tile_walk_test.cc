#include <gtest/gtest.h>
#include <hwy/targets.h>

#include <cmath>
#include <numbers>
#include <numeric>
#include <random>

#include "kernels/cpu/simd_kernels.h"
#include "kernels/math/tile_cover.h"

// The walk over the entries of a tile on the CPU visits only blocks of pixels that an ellipse
// reaches. One splat at a time, against the power of each pixel in double.

namespace pepeseg {
namespace {

constexpr float kTileX = 1008, kTileY = 512;

// Returns a splat with standard deviations of `major` and `minor` pixels.
Splat Ellipse(double x, double y, double major, double minor, double angle, float opacity) {
  const double c = std::cos(angle), s = std::sin(angle);
  const double a = 1 / (major * major), b = 1 / (minor * minor);
  const double xx = c * c * a + s * s * b, xy = c * s * (a - b), yy = s * s * a + c * c * b;
  const auto determinant = static_cast<float>(major * major * minor * minor);
  const auto root = MakePowerRoot(static_cast<float>(xx), static_cast<float>(xy), determinant);
  Splat splat = {};
  splat.x = static_cast<float>(x);
  splat.y = static_cast<float>(y);
  splat.root_xx = root.xx;
  splat.root_xy = root.xy;
  splat.root_yy = root.yy;
  splat.opacity = opacity;
  splat.min_power = MinPower(opacity);
  splat.half_height =
      SplatHalfExtent(splat.min_power, root.yy, static_cast<float>(yy), determinant).height;
  return splat;
}

double PowerAt(const Splat& s, int x, int y) {
  const double dx = static_cast<double>(kTileX) + x + 0.5 - static_cast<double>(s.x);
  const double dy = static_cast<double>(kTileY) + y + 0.5 - static_cast<double>(s.y);
  const double u = static_cast<double>(s.root_xx) * dx + static_cast<double>(s.root_xy) * dy;
  const double v = static_cast<double>(s.root_yy) * dy;
  return -u * u - v * v;
}

// The kernels of a set that this machine has.
const SimdKernels& KernelsOf(int64_t set) {
  hwy::SetSupportedTargetsForTest(set);
  const SimdKernels& kernels = BestSimdKernels();
  hwy::SetSupportedTargetsForTest(0);
  return kernels;
}

// Weights of the splat at all pixels of the tile, in the order of TilePixel.
std::vector<float> WeightsOf(const SimdKernels& simd, const Splat& splat) {
  const int32_t entry = 0, slot = 0;
  const TileSplats tile = {&splat, &entry, &slot, 0, 1, kTileX, kTileY, kTileSize, kTileSize};
  std::vector<int32_t> pixels(kTilePixels);
  std::iota(pixels.begin(), pixels.end(), 0);
  std::vector<float> weights(kTilePixels);
  simd.pixel_weights(tile, pixels, weights.data());
  return weights;
}

// Expects a weight exactly where the power is large enough, but for pixels at the very border.
// Returns the number of pixels with a weight.
int ExpectWeightsOf(const SimdKernels& simd, const Splat& splat) {
  const std::vector<float> weights = WeightsOf(simd, splat);
  int num_reached = 0;
  for (int y = 0; y < kTileSize; ++y) {
    for (int x = 0; x < kTileSize; ++x) {
      const double over = PowerAt(splat, x, y) - static_cast<double>(splat.min_power);
      const bool reached = weights[TilePixel(x, y)] > 0;
      num_reached += static_cast<int>(reached);
      if (std::abs(over) < 0.01) continue;
      EXPECT_EQ(reached, over > 0) << x << " " << y << " over by " << over;
    }
  }
  return num_reached;
}

class TileWalkTest : public testing::TestWithParam<int64_t> {
 protected:
  void SetUp() override {
    if ((hwy::SupportedTargets() & GetParam()) == 0) GTEST_SKIP() << "not on this machine";
  }
};
INSTANTIATE_TEST_SUITE_P(Sets, TileWalkTest, testing::Values(HWY_AVX3, HWY_AVX2, HWY_SSE4));

TEST_P(TileWalkTest, ReachesEveryPixelOfAnEllipse) {
  const SimdKernels& simd = KernelsOf(GetParam());
  std::mt19937 random(5);
  std::uniform_real_distribution<double> unit(0, 1);
  int num_reached = 0;
  for (int i = 0; i < 10'000; ++i) {
    const double major = 0.55 * std::exp(unit(random) * 6),
                 minor = 0.55 * std::exp(unit(random) * 3);
    // The ellipse reaches 3.3 standard deviations.
    const double away = 3.5 * major * std::sqrt(unit(random)), to = unit(random) * 6.3;
    const double x = kTileX + 16 * unit(random) + away * std::cos(to);
    const double y = kTileY + 16 * unit(random) + away * std::sin(to);
    const auto opacity = static_cast<float>(0.004 + 0.99 * unit(random) * unit(random));
    num_reached += ExpectWeightsOf(
        simd, Ellipse(x, y, major, minor, unit(random) * std::numbers::pi, opacity));
    if (testing::Test::HasFailure()) FAIL() << "ellipse " << i;
  }
  EXPECT_GT(num_reached, 50'000);
}

TEST_P(TileWalkTest, ReachesThePixelsOfNeedlesAcrossTheTile) {
  const SimdKernels& simd = KernelsOf(GetParam());
  std::mt19937 random(6);
  std::uniform_real_distribution<double> unit(0, 1);
  int num_reached = 0;
  for (int i = 0; i < 2000; ++i) {
    const double angle = unit(random) * std::numbers::pi, along = 1000 * (unit(random) - 0.5);
    const double x = kTileX + 16 * unit(random) + along * std::cos(angle);
    const double y = kTileY + 16 * unit(random) + along * std::sin(angle);
    num_reached += ExpectWeightsOf(simd, Ellipse(x, y, 300, 0.55, angle, 0.9f));
    if (testing::Test::HasFailure()) FAIL() << "needle " << i;
  }
  EXPECT_GT(num_reached, 20'000);
}

TEST(TilePixels, NumberThePixelsOfATileByBlocks) {
  std::vector<int> count(kTilePixels);
  for (int y = 0; y < kTileSize; ++y) {
    for (int x = 0; x < kTileSize; ++x) {
      ++count[TilePixel(x, y)];
      EXPECT_EQ(TilePixel(x, y) / kBlockPixels, y / 4 * 4 + x / 4);
    }
  }
  EXPECT_EQ(count, std::vector<int>(kTilePixels, 1));
}

}  // namespace
}  // namespace pepeseg
