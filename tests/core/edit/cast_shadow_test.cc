#include "core/edit/cast_shadow.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace pepeseg {
namespace {

constexpr int kFloorWidth = 60, kFloorHeight = 50;

// A floor with some texture, on which a thing stands at [20, 30) x [20, 30).
struct Floor {
  HolePicture picture{kFloorWidth, kFloorHeight, {}, {}, {}};
  std::vector<uint8_t> foot;

  Floor() : foot(kFloorWidth * kFloorHeight) {
    std::mt19937_64 random(1);
    std::normal_distribution<double> texture(0, 0.02);
    picture.known.assign(foot.size(), 1);
    picture.hole.assign(foot.size(), 0);
    picture.values.resize(kFloorWidth * kFloorHeight, 3);
    for (int i = 0; i < kFloorWidth * kFloorHeight; ++i) {
      picture.values.row(i) = Eigen::RowVector3d(0.6, 0.5, 0.4).array() + texture(random);
    }
    for (int y = 20; y < 30; ++y) {
      for (int x = 20; x < 30; ++x) {
        foot[y * kFloorWidth + x] = picture.hole[y * kFloorWidth + x] = 1;
        picture.known[y * kFloorWidth + x] = 0;
        picture.values.row(y * kFloorWidth + x).setZero();
      }
    }
  }
  // Multiplies the colours in [left, right) x [20, 30).
  void Multiply(int left, int right, const Eigen::RowVector3d& factor) {
    for (int y = 20; y < 30; ++y) {
      for (int x = left; x < right; ++x)
        picture.values.row(y * kFloorWidth + x).array() *= factor.array();
    }
  }
  CastShadow Find() const { return FindShadow(picture, foot); }
};

TEST(CastShadow, FindsTheShadowAndItsFactor) {
  Floor floor;
  floor.Multiply(30, 45, {0.6, 0.6, 0.63});
  const CastShadow shadow = floor.Find();
  ASSERT_FALSE(shadow.share.empty());
  EXPECT_NEAR(shadow.gain[0], 1 / 0.6, 0.05);
  EXPECT_NEAR(shadow.gain[2], 1 / 0.63, 0.05);
  for (int y = 0; y < kFloorHeight; ++y) {
    for (int x = 0; x < kFloorWidth; ++x) {
      const float share = shadow.share[y * kFloorWidth + x];
      if (x >= 33 && x < 42 && y >= 23 && y < 27) {
        EXPECT_EQ(share, 1) << x << ", " << y;
      }
      if (x < 26 || x > 50 || y < 15 || y > 34) {
        EXPECT_EQ(share, 0) << x << ", " << y;
      }
    }
  }
  EXPECT_NEAR(shadow.GainAt(25 * kFloorWidth + 38)[0], shadow.gain[0], 1e-9);
  EXPECT_EQ(shadow.GainAt(5 * kFloorWidth + 5)[0], 1);
}

TEST(CastShadow, FindsNoneWithoutOne) { EXPECT_TRUE(Floor().Find().share.empty()); }

TEST(CastShadow, LeavesTheShadowsOfOthers) {
  Floor floor;
  floor.Multiply(40, 55, {0.6, 0.6, 0.6});  // does not touch the thing
  EXPECT_TRUE(floor.Find().share.empty());
}

TEST(CastShadow, LeavesWhatHasAnotherColour) {
  Floor floor;
  floor.Multiply(30, 45, {0.9, 0.4, 0.4});  // a red cloth
  EXPECT_TRUE(floor.Find().share.empty());
}

TEST(CastShadow, LeavesWhatGoesOnOutsideOfThePicture) {
  Floor floor;
  for (int i = 0; i < kFloorWidth * kFloorHeight; ++i) {
    if (i % kFloorWidth >= 30) floor.picture.values.row(i) *= 0.6;  // a dark half of the floor
  }
  EXPECT_TRUE(floor.Find().share.empty());
}

}  // namespace
}  // namespace pepeseg
