#include "core/features/neighbor_graph.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

namespace pepeseg {
namespace {

Gaussians RandomMeans(int64_t count, bool on_grid) {
  Gaussians gaussians = Gaussians::Zero(count, 0);
  std::mt19937_64 engine(7);
  for (int axis = 0; axis < 3; ++axis) {
    for (float& x : gaussians.Plane(kMeanPlane + axis)) {
      x = on_grid ? static_cast<float>(engine() % 4)
                  : static_cast<float>(engine() % 10'000) * 1e-3f;
    }
  }
  return gaussians;
}

double Distance(const Gaussians& gaussians, int64_t a, int64_t b) {
  double squares = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const auto plane = gaussians.Plane(kMeanPlane + axis);
    squares += std::pow(double{plane[a]} - plane[b], 2);
  }
  return std::sqrt(squares);
}

// On the grid many means are equal, and many distances.
TEST(NearestNeighbors, ReturnsTheNearestWithTheGaussianItselfFirst) {
  for (const bool on_grid : {false, true}) {
    const Gaussians gaussians = RandomMeans(3000, on_grid);
    const std::vector<int32_t> neighbors = NearestNeighbors(gaussians, 16);
    ASSERT_EQ(neighbors.size(), 3000u * 16);
    for (int64_t i = 0; i < 3000; i += 37) {
      std::vector<double> all, got;
      for (int64_t j = 0; j < 3000; ++j) all.push_back(Distance(gaussians, i, j));
      std::partial_sort(all.begin(), all.begin() + 16, all.end());
      std::vector<int32_t> own(neighbors.begin() + i * 16, neighbors.begin() + (i + 1) * 16);
      EXPECT_EQ(own[0], i);
      for (const int32_t j : own) got.push_back(Distance(gaussians, i, j));
      std::sort(got.begin(), got.end());
      for (int k = 0; k < 16; ++k) ASSERT_NEAR(got[k], all[k], 1e-6);
      std::sort(own.begin(), own.end());
      EXPECT_EQ(std::unique(own.begin(), own.end()), own.end());
    }
  }
}

TEST(NearestNeighbors, RepeatsTheGaussianItselfIfThereAreTooFew) {
  const std::vector<int32_t> neighbors = NearestNeighbors(RandomMeans(3, false), 5);
  for (int32_t i = 0; i < 3; ++i) {
    const auto own = neighbors.begin() + i * 5;
    EXPECT_EQ(*own, i);
    EXPECT_EQ(std::count(own, own + 5, i), 3);
  }
  EXPECT_TRUE(NearestNeighbors(Gaussians::Zero(0, 0), 5).empty());
}

TEST(NearestNeighbors, IsDeterministic) {
  const Gaussians gaussians = RandomMeans(5000, true);
  EXPECT_EQ(NearestNeighbors(gaussians, 8), NearestNeighbors(gaussians, 8));
}

}  // namespace
}  // namespace pepeseg
