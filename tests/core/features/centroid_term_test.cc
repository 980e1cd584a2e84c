#include "core/features/centroid_term.h"

#include <gtest/gtest.h>

#include <cmath>

namespace pepeseg {
namespace {

// Along axis k, turned by `angle` towards the last axis.
std::vector<float> Direction(int k, double angle) {
  std::vector<float> direction(32);
  direction[k] = static_cast<float>(std::cos(angle));
  direction[31] = static_cast<float>(std::sin(angle));
  return direction;
}

TEST(CentroidBank, KeepsWhatIsNewAndMovesWhatIsSeenAgain) {
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
  bank.Merge(Direction(1, 0.6));  // too far
  EXPECT_EQ(bank.centroids().size(), 3u * 32);
}

// Clusters of one view are apart by HDBSCAN's word, however close they are.
TEST(CentroidBank, DoesNotMergeClustersOfOneView) {
  CentroidBank bank(0.9f);
  std::vector<float> two = Direction(0, 0);
  const std::vector<float> near = Direction(0, 0.1);
  two.insert(two.end(), near.begin(), near.end());
  bank.Merge(two);
  EXPECT_EQ(bank.centroids().size(), 2u * 32);
}

}  // namespace
}  // namespace pepeseg
