#include "core/reconstruct/depth_agreement.h"

#include <gtest/gtest.h>

namespace pepeseg {
namespace {

bool Window(DepthAgreement& agreement, int num_agreeing, int num_others) {
  for (int i = 0; i < num_agreeing; ++i) agreement.Add(0.7);
  for (int i = 0; i < num_others; ++i) agreement.Add(i % 2 == 0 ? 0.05 : -3.0);
  return agreement.Failed();
}

TEST(DepthAgreement, FailsAfterTwoWindowsOfTooFew) {
  DepthAgreement agreement(0.5);
  EXPECT_FALSE(Window(agreement, 4, 6));
  EXPECT_FALSE(Window(agreement, 5, 5));  // as many as are asked for
  EXPECT_FALSE(Window(agreement, 4, 6));
  EXPECT_TRUE(Window(agreement, 0, 10));
}

TEST(DepthAgreement, AWindowWithoutComparisonsSaysNothing) {
  DepthAgreement agreement(0.5);
  EXPECT_FALSE(Window(agreement, 0, 10));
  EXPECT_FALSE(Window(agreement, 0, 0));
  EXPECT_FALSE(Window(agreement, 0, 10));
}

TEST(DepthAgreement, WithoutAShareNothingFails) {
  DepthAgreement agreement(0);
  for (int i = 0; i < 3; ++i) EXPECT_FALSE(Window(agreement, 0, 10));
}

TEST(DepthAgreement, GoesOnWhereItStood) {
  DepthAgreement unbroken(0.5), resumed(0.5);
  EXPECT_FALSE(Window(unbroken, 0, 10));
  unbroken.Add(0);
  resumed.Restore(unbroken.state());
  EXPECT_TRUE(resumed.Failed());
}

}  // namespace
}  // namespace pepeseg
