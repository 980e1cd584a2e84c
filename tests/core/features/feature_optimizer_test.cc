#include "core/features/feature_optimizer.h"

#include <gtest/gtest.h>

namespace pepeseg {
namespace {

TEST(ShareOfFall, GrowsEvenlyWithTheSteps) {
  EXPECT_EQ(ShareOfFall(0, 1000, {}), 0);
  EXPECT_EQ(ShareOfFall(250, 1000, {}), 0.25);
  EXPECT_EQ(ShareOfFall(1000, 1000, {}), 1);
}

TEST(ShareOfFall, FallsFasterWithoutAJumpAfterStepsAreLeftOut) {
  const LeftOutSteps left_out = {400, 450};  // of the 600 steps after step 400, 150 remain
  EXPECT_EQ(ShareOfFall(400, 1000, left_out), 0.4);
  EXPECT_NEAR(ShareOfFall(401, 1000, left_out), 0.404, 1e-12);
  EXPECT_NEAR(ShareOfFall(475, 1000, left_out), 0.7, 1e-12);
  EXPECT_EQ(ShareOfFall(550, 1000, left_out), 1);
  EXPECT_EQ(ShareOfFall(1000, 1000, left_out), 1);
  for (int done = 0; done < 1000; ++done) {
    EXPECT_LE(ShareOfFall(done, 1000, left_out), ShareOfFall(done + 1, 1000, left_out));
  }
}

TEST(ShareOfFall, IsOneWhereNoStepRemains) { EXPECT_EQ(ShareOfFall(401, 1000, {400, 600}), 1); }

}  // namespace
}  // namespace pepeseg
