#include "core/features/cluster_agreement.h"

#include <gtest/gtest.h>

#include <limits>
#include <vector>

namespace pepeseg {
namespace {

constexpr float kFinest = 0, kAll = std::numeric_limits<float>::infinity();

// One row of 12 pixels: a whole over 0..9 that holds two parts, 0..4 and 5..9; nothing over 10, 11.
struct Row {
  Row() {
    std::vector<BinaryMask> masks(3);
    for (int x = 0; x < 12; ++x) {
      masks[0].pixels.push_back(x < 10 ? 1 : 0);
      masks[1].pixels.push_back(x < 5 ? 1 : 0);
      masks[2].pixels.push_back(x >= 5 && x < 10 ? 1 : 0);
      pixels.push_back(x);
    }
    set = BuildMaskSet(12, 1, masks);
  }
  Clusters Keep(const std::vector<int>& labels, int count, float scale) const {
    return KeepAgreeing({count, labels, std::vector<float>(12)}, set, pixels, scales, scale);
  }
  MaskSet set;
  std::vector<int32_t> pixels;
  std::vector<float> scales = {2, 1, 1};
};

TEST(KeepAgreeing, DropsAClusterOfTwoPartsAtTheFineScaleOnly) {
  const Row row;
  const std::vector<int> whole = {0, 0, 0, 0, 0, 0, 0, 0, 0, 0, -1, -1};
  EXPECT_EQ(row.Keep(whole, 1, kFinest).count, 0);
  EXPECT_EQ(row.Keep(whole, 1, kFinest).labels, std::vector<int>(12, kNoise));
  EXPECT_EQ(row.Keep(whole, 1, kAll).count, 1);
  EXPECT_EQ(row.Keep(whole, 1, kAll).labels, whole);
}

TEST(KeepAgreeing, NumbersWhatIsLeftInOrder) {
  const Row row;
  // Half of either part, then the second part nearly alone.
  const Clusters kept = row.Keep({1, 1, 0, 0, -1, 1, 1, 2, 2, 2, 2, 0}, 3, kFinest);
  EXPECT_EQ(kept.count, 2);
  EXPECT_EQ(kept.labels, (std::vector<int>{-1, -1, 0, 0, -1, -1, -1, 1, 1, 1, 1, 0}));
}

TEST(KeepAgreeing, PixelsUnderNoMaskSayNothing) {
  const Row row;
  const Clusters kept = row.Keep({-1, -1, -1, -1, 0, -1, -1, -1, -1, -1, 0, 0}, 1, kFinest);
  EXPECT_EQ(kept.count, 1);
  EXPECT_EQ(row.Keep({-1, -1, -1, -1, -1, -1, -1, -1, -1, -1, 0, 0}, 1, kAll).count, 1);
}

}  // namespace
}  // namespace pepeseg
