#include "core/base/progress.h"

#include <gtest/gtest.h>

#include <limits>

namespace pepeseg {
namespace {

// Records a window of these losses and returns StoppedFalling().
bool Window(Convergence& convergence, std::initializer_list<double> losses) {
  for (const double loss : losses) convergence.Add(loss);
  return convergence.StoppedFalling();
}

TEST(Convergence, ComparesEachWindowWithTheOneBefore) {
  Convergence convergence(0.1);
  EXPECT_FALSE(Window(convergence, {3, 1}));  // no window before
  EXPECT_FALSE(Window(convergence, {1.79, 1.79}));
  EXPECT_TRUE(Window(convergence, {1.0, 2.3}));  // 1.65: over 0.9 * 1.79
  EXPECT_TRUE(Window(convergence, {5, 5}));      // it rises
}

TEST(Convergence, TakesTheShareOfTheSizeOfNegativeLosses) {
  Convergence convergence(0.1);
  EXPECT_FALSE(Window(convergence, {-2}));
  EXPECT_FALSE(Window(convergence, {-2.3}));
  EXPECT_TRUE(Window(convergence, {-2.5}));
}

TEST(Convergence, NeverStopsWithoutAShare) {
  Convergence convergence(0);
  for (int i = 0; i < 5; ++i) EXPECT_FALSE(Window(convergence, {1, 1}));
}

TEST(Convergence, IgnoresLossesThatAreNotFinite) {
  Convergence convergence(0.1);
  EXPECT_FALSE(Window(convergence, {1, std::numeric_limits<double>::quiet_NaN()}));
  EXPECT_TRUE(Window(convergence, {std::numeric_limits<double>::infinity(), 0.95}));
  EXPECT_EQ(convergence.state().before, 0.95);
}

TEST(Convergence, ResumesFromItsState) {
  Convergence unbroken(0.1);
  Window(unbroken, {2, 2});
  unbroken.Add(1.9);
  Convergence resumed(0.1);
  resumed.Restore(unbroken.state());
  EXPECT_TRUE(Window(resumed, {1.9}));
}

TEST(Convergence, HasWindowsOfWholeRoundsOfTheViews) {
  EXPECT_EQ(Convergence::Window(49), 539);
  EXPECT_EQ(Convergence::Window(500), 500);
  EXPECT_EQ(Convergence::Window(501), 501);
  EXPECT_EQ(Convergence::Window(1), 500);
  EXPECT_EQ(Convergence::Window(0), 500);
}

}  // namespace
}  // namespace pepeseg
