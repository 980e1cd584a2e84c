#include "core/evaluate/reference_choice.h"

#include <gtest/gtest.h>

#include <vector>

namespace pepeseg {
namespace {

using Values = std::vector<double>;

const Values kScales = {0.1, 0.2, 0.3, 0.4, 0.5};
const Values kThresholds = {0.5, 0.55, 0.6, 0.65, 0.7, 0.75, 0.8};

// A table with `low` everywhere.
Values Table(double low) { return Values(kScales.size() * kThresholds.size(), low); }
double& At(Values& table, size_t scale, size_t threshold) {
  return table[scale * kThresholds.size() + threshold];
}

TEST(BestCell, IsTheFirstOfTheBest) {
  Values table = Table(0.2);
  At(table, 3, 1) = At(table, 2, 4) = 0.9;
  const GridCell cell = BestCell(table, kThresholds.size());
  EXPECT_EQ(cell.scale, 2);
  EXPECT_EQ(cell.threshold, 4);
}

TEST(ChooseFromReference, TakesTheMiddleOfAPlateauOneStepLower) {
  Values table = Table(0.2);
  for (size_t s = 1; s <= 3; ++s) {
    for (size_t t = 2; t <= 6; ++t) At(table, s, t) = 0.9;
  }
  const GridCell cell = ChooseFromReference(table, kScales, kThresholds);
  EXPECT_EQ(cell.scale, 2);
  EXPECT_EQ(cell.threshold, 3);  // the middle is 4
}

TEST(ChooseFromReference, PrefersAPlateauToASpikeThatIsHardlyBetter) {
  Values table = Table(0.2);
  for (size_t s = 0; s <= 2; ++s) {
    for (size_t t = 1; t <= 3; ++t) At(table, s, t) = 0.9;
  }
  At(table, 4, 6) = 0.905;
  const GridCell cell = ChooseFromReference(table, kScales, kThresholds);
  EXPECT_EQ(cell.scale, 1);
  EXPECT_LE(cell.threshold, 2);
}

TEST(ChooseFromReference, NeverTakesACellThatIsMuchWorseThanTheBest) {
  // The mean of two plateaus lies between them, where the IoU is low.
  Values table = Table(0.2);
  At(table, 0, 0) = At(table, 4, 6) = 0.9;
  const GridCell cell = ChooseFromReference(table, kScales, kThresholds);
  EXPECT_EQ(At(table, cell.scale, cell.threshold), 0.9);
}

TEST(ChooseFromReference, TakesTheOnlyCellThereIs) {
  const GridCell cell = ChooseFromReference(Values{0.4}, Values{0.5}, Values{0.75});
  EXPECT_EQ(cell.scale, 0);
  EXPECT_EQ(cell.threshold, 0);
}

}  // namespace
}  // namespace pepeseg
