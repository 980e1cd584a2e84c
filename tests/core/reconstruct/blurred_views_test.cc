#include "core/reconstruct/blurred_views.h"

#include <gtest/gtest.h>

#include <cmath>
#include <set>
#include <vector>

#include "core/reconstruct/trainer.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/textured_place.h"

namespace pepeseg {
namespace {

// Photographs of a place, of which the first is held out.
Capture Place(int num_views) {
  Capture capture;
  capture.views = testing::PhotographPlace(testing::PlaceArc(num_views), 1);
  capture.views[0].held_out = true;
  return capture;
}

void Blur(View& view, int radius) { view.photo = testing::Blurred(view.photo, radius); }

// Returns the numbers of the blurred views among the training views.
std::set<size_t> NumbersOf(const std::vector<bool>& blurred) {
  std::set<size_t> numbers;
  for (size_t i = 0; i < blurred.size(); ++i) {
    if (blurred[i]) numbers.insert(i);
  }
  return numbers;
}

TEST(Sharpness, FallsWithTheBlur) {
  View view = Place(1).views[0];
  const double sharp = Sharpness(view);
  Blur(view, 1);
  const double soft = Sharpness(view);
  EXPECT_LT(soft, sharp - kBlurred);
  Blur(view, 2);
  EXPECT_LT(Sharpness(view), soft - kBlurred);
}

TEST(Sharpness, DoesNotDependOnContrastAndIgnoredPixels) {
  View view = Place(1).views[0];
  const double sharp = Sharpness(view);
  View faint = view;
  for (uint8_t& value : faint.photo.pixels) value = static_cast<uint8_t>(60 + value / 2);
  EXPECT_NEAR(Sharpness(faint), sharp, 0.05);  // rounding adds noise
  // Ignored noise.
  view.ignore.assign(static_cast<size_t>(view.photo.width) * view.photo.height, 0);
  for (size_t pixel = 0; pixel < view.ignore.size() / 3; ++pixel) {
    view.ignore[pixel] = 1;
    view.photo.pixels[3 * pixel] = static_cast<uint8_t>(pixel * 7919);
  }
  EXPECT_NEAR(Sharpness(view), sharp, kBlurred / 2);
}

TEST(Sharpness, IsNotANumberWithoutEnoughGradients) {
  View view;
  view.photo = {400, 300, 3, std::vector<uint8_t>(size_t{3} * 400 * 300, 100)};
  EXPECT_TRUE(std::isnan(Sharpness(view)));
  view.photo = {100, 90, 3, {}};
  for (int i = 0; i < 3 * 100 * 90; ++i)
    view.photo.pixels.push_back(static_cast<uint8_t>(i * 7919));
  EXPECT_TRUE(std::isnan(Sharpness(view)));
  view.photo = {1, 1, 3, {1, 2, 3}};
  EXPECT_TRUE(std::isnan(Sharpness(view)));
}

TEST(FindBlurred, FindsWhatIsLessSharpThanItsNeighbors) {
  Capture capture = Place(14);
  EXPECT_EQ(NumbersOf(FindBlurred(capture)), (std::set<size_t>{}));
  Blur(capture.views[0], 2);  // is held out
  Blur(capture.views[4], 1);
  Blur(capture.views[5], 2);
  EXPECT_EQ(FindBlurred(capture).size(), 13u);
  EXPECT_EQ(NumbersOf(FindBlurred(capture)), (std::set<size_t>{3, 4}));
}

TEST(FindBlurred, FindsNothingWhereAllAreBlurred) {
  Capture capture = Place(10);
  for (View& view : capture.views) Blur(view, 2);
  EXPECT_EQ(NumbersOf(FindBlurred(capture)), (std::set<size_t>{}));
}

TEST(FindBlurred, FindsNothingAmongFewViews) {
  Capture capture = Place(8);  // 7 training views
  Blur(capture.views[3], 2);
  EXPECT_EQ(NumbersOf(FindBlurred(capture)), (std::set<size_t>{}));
}

TEST(GaussianTrainer, LeavesBlurredViewsOutOfItsRounds) {
  Capture capture = Place(10);
  Blur(capture.views[4], 2);
  const auto backend = MakeCpuBackend(1);
  // Returns whether view 3 of the training views is in each of 20 rounds.
  const auto num_rounds_of = [&](double share) {
    ReconstructOptions options;
    options.blurred_share = share;
    options.num_random_points = 50;
    int num_rounds = 0;
    for (uint64_t seed = 1; seed <= 20; ++seed) {
      options.seed = seed;
      const auto trainer = GaussianTrainer::Create(*backend, capture, options);
      if (!trainer.ok()) return -1;
      if (!(*trainer)->Step().ok()) return -1;
      const auto checkpoint = (*trainer)->Save();
      if (!checkpoint.ok()) return -1;
      // The first of a round of 9, or of 8, was drawn.
      num_rounds += checkpoint->views_left.size() == 8;
    }
    return num_rounds;
  };
  EXPECT_EQ(num_rounds_of(1), 20);
  EXPECT_EQ(num_rounds_of(0), 0);
  const int some = num_rounds_of(0.5);
  EXPECT_GT(some, 4);
  EXPECT_LT(some, 16);
}

}  // namespace
}  // namespace pepeseg
