#include "core/features/centroid_term.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

namespace pepeseg {
namespace {

// Returns a unit vector along axis k, rotated by `angle` towards the last axis.
std::vector<float> Direction(int k, double angle) {
  std::vector<float> direction(32);
  direction[k] = static_cast<float>(std::cos(angle));
  direction[31] = static_cast<float>(std::sin(angle));
  return direction;
}

TEST(CentroidBank, AddsNewClustersAndMovesTheCentroidsOfKnownOnes) {
  CentroidBank bank(0.9f);
  bank.Merge(Direction(0, 0));
  bank.Merge(Direction(1, 0));
  ASSERT_EQ(bank.centroids().size(), 2u * 32);
  bank.Merge(Direction(1, 0.3));  // cosine 0.955
  ASSERT_EQ(bank.centroids().size(), 2u * 32);
  const double x = 0.9 + 0.1 * std::cos(0.3), y = 0.1 * std::sin(0.3), length = std::hypot(x, y);
  EXPECT_NEAR(bank.centroids()[32 + 1], x / length, 1e-6);
  EXPECT_NEAR(bank.centroids()[32 + 31], y / length, 1e-6);
  EXPECT_EQ(bank.centroids()[0], 1);
  bank.Merge(Direction(1, 0.6));  // too far: a new centroid
  EXPECT_EQ(bank.centroids().size(), 3u * 32);
}

// HDBSCAN has found the clusters of one view to be apart, however close they are.
TEST(CentroidBank, DoesNotMergeClustersOfOneView) {
  CentroidBank bank(0.9f);
  std::vector<float> two = Direction(0, 0);
  const std::vector<float> near = Direction(0, 0.1);
  two.insert(two.end(), near.begin(), near.end());
  bank.Merge(two);
  EXPECT_EQ(bank.centroids().size(), 2u * 32);
}

// Scales at which a label has the finest mask alone, and all masks.
constexpr float kFinest = 0, kAll = std::numeric_limits<float>::infinity();

// An image of 12 x 1 pixels. One mask covers pixels 0..9, and two parts of it cover 0..4 and 5..9.
// No mask covers pixels 10 and 11.
struct Scanline {
  Scanline() {
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
  const Scanline scanline;
  const std::vector<int> whole = {0, 0, 0, 0, 0, 0, 0, 0, 0, 0, -1, -1};
  EXPECT_EQ(scanline.Keep(whole, 1, kFinest).count, 0);
  EXPECT_EQ(scanline.Keep(whole, 1, kFinest).labels, std::vector<int>(12, kNoise));
  EXPECT_EQ(scanline.Keep(whole, 1, kAll).count, 1);
  EXPECT_EQ(scanline.Keep(whole, 1, kAll).labels, whole);
}

TEST(KeepAgreeing, KeepsTheOrderOfTheRemainingClusters) {
  const Scanline scanline;
  // Cluster 1 has half of either part, cluster 2 only pixels of the second part.
  const Clusters kept = scanline.Keep({1, 1, 0, 0, -1, 1, 1, 2, 2, 2, 2, 0}, 3, kFinest);
  EXPECT_EQ(kept.count, 2);
  EXPECT_EQ(kept.labels, (std::vector<int>{-1, -1, 0, 0, -1, -1, -1, 1, 1, 1, 1, 0}));
}

TEST(KeepAgreeing, IgnoresPixelsWithoutALabel) {
  const Scanline scanline;
  const Clusters kept = scanline.Keep({-1, -1, -1, -1, 0, -1, -1, -1, -1, -1, 0, 0}, 1, kFinest);
  EXPECT_EQ(kept.count, 1);
  EXPECT_EQ(scanline.Keep({-1, -1, -1, -1, -1, -1, -1, -1, -1, -1, 0, 0}, 1, kAll).count, 1);
}

}  // namespace
}  // namespace pepeseg
