#include "tests/bench/capture_faults.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "tests/testing/crowded_capture.h"

namespace pepeseg {
namespace {

CapturePack SmallPack() {
  testing::CrowdedOptions options;
  options.num_views = 9;  // 2 of them held out
  options.width = 80;
  options.height = 60;
  testing::CrowdedScene scene = testing::MakeCrowdedScene(options);
  return {std::move(scene.capture), {{"part", scene.parts.entities, scene.parts.labels}}};
}

CapturePack Spoilt(const CaptureFaults& faults) {
  CapturePack pack = SmallPack();
  Spoil(faults, pack);
  return pack;
}

int NumMasks(const CapturePack& pack) {
  int num_masks = 0;
  for (const View& view : pack.capture.views) num_masks += view.masks.num_masks;
  return num_masks;
}

TEST(Spoil, WithoutFaultsNothingChanges) {
  const CapturePack before = SmallPack(), after = Spoilt({});
  ASSERT_EQ(after.capture.views.size(), before.capture.views.size());
  for (size_t v = 0; v < before.capture.views.size(); ++v) {
    const View &was = before.capture.views[v], &is = after.capture.views[v];
    EXPECT_EQ(is.name, was.name);
    EXPECT_EQ(is.masks.pixel_cell, was.masks.pixel_cell);
    EXPECT_EQ(is.depth.values, was.depth.values);
    EXPECT_EQ(is.cam_from_world.rotation.coeffs(), was.cam_from_world.rotation.coeffs());
    EXPECT_EQ(after.truth[0].labels[v], before.truth[0].labels[v]);
  }
}

TEST(Spoil, KeepsTheHeldOutViewsAndAShareOfTheOthersWithTheirTruth) {
  const CapturePack before = SmallPack(), after = Spoilt({.keep_views = 0.25});
  std::vector<std::string> names;
  for (const View& view : after.capture.views) names.push_back(view.name);
  const std::vector<View>& views = before.capture.views;  // 0 and 8 are held out
  EXPECT_THAT(names,
              ::testing::ElementsAre(views[0].name, views[1].name, views[5].name, views[8].name));
  EXPECT_EQ(after.truth[0].labels[3], before.truth[0].labels[8]);
}

TEST(Spoil, KeepsAShareOfTheMasks) {
  const int before = NumMasks(SmallPack()), after = NumMasks(Spoilt({.keep_masks = 0.7}));
  EXPECT_NEAR(after, 0.7 * before, 0.15 * before);
}

TEST(Spoil, BendsMasksByAboutTheNoiseAskedFor) {
  const CapturePack before = SmallPack(), after = Spoilt({.mask_noise = 2});
  const View &was = before.capture.views[1], &is = after.capture.views[1];
  int64_t changed = 0, covered = 0;
  for (size_t i = 0; i < was.masks.pixel_cell.size(); ++i) {
    const int x = static_cast<int>(i) % was.camera.width,
              y = static_cast<int>(i) / was.camera.width;
    const auto bits_were = was.masks.BitsAt(x, y), bits_are = is.masks.BitsAt(x, y);
    covered += was.masks.pixel_cell[i] != 0;
    changed += !std::ranges::equal(bits_were, bits_are);
  }
  EXPECT_GT(changed, covered / 20);
  EXPECT_LT(changed, covered);
  EXPECT_EQ(before.capture.views[0].masks.pixel_cell, after.capture.views[0].masks.pixel_cell);
}

TEST(Spoil, TurnsTheTrainingViewsByAboutTheNoiseAskedFor) {
  const CapturePack before = SmallPack(), after = Spoilt({.pose_noise = 0.5});
  double squares = 0;
  for (size_t v = 0; v < before.capture.views.size(); ++v) {
    const View &was = before.capture.views[v], &is = after.capture.views[v];
    const Eigen::Vector3d center = was.cam_from_world.Inverse().translation;
    EXPECT_LT((is.cam_from_world.Inverse().translation - center).norm(), 1e-9) << "it has moved";
    // The new position of what was at the centre of the image.
    const Eigen::Vector3d ahead = was.cam_from_world.Inverse() * Eigen::Vector3d(0, 0, 1);
    const Eigen::Vector3d seen = is.cam_from_world * ahead;
    const double x = was.camera.fx * seen.x() / seen.z(), y = was.camera.fy * seen.y() / seen.z();
    if (was.held_out) {
      EXPECT_LT(std::hypot(x, y), 1e-9);
    }
    squares += x * x + y * y;
  }
  const double deviation = std::sqrt(squares / (2 * 7));  // two axes, seven views
  EXPECT_GT(deviation, 0.25);
  EXPECT_LT(deviation, 0.8);
}

TEST(Spoil, TurnsDepthUpsideDown) {
  const CapturePack before = SmallPack(), after = Spoilt({.invert_depth = true});
  const auto &were = before.capture.views[1].depth.values,
             &are = after.capture.views[1].depth.values;
  ASSERT_FALSE(were.empty());
  for (size_t i = 0; i < were.size(); ++i) ASSERT_EQ(are[i], 1 - were[i]);
}

// Returns the number of training photographs that the faults change. None that is held out may
// change.
int NumChanged(const CaptureFaults& faults) {
  const CapturePack before = SmallPack(), after = Spoilt(faults);
  int num_changed = 0;
  for (size_t v = 0; v < before.capture.views.size(); ++v) {
    const bool changed =
        before.capture.views[v].photo.pixels != after.capture.views[v].photo.pixels;
    EXPECT_FALSE(changed && before.capture.views[v].held_out);
    num_changed += changed ? 1 : 0;
  }
  return num_changed;
}

TEST(Spoil, BlursAShareOfTheTrainingPhotographs) {
  EXPECT_EQ(NumChanged({.blur_views = 1}), 7);
  const int half = NumChanged({.blur_views = 0.5});
  EXPECT_GT(half, 0);
  EXPECT_LT(half, 7);
}

TEST(Spoil, BlurLeavesAnEvenPhotographAsItIs) {
  CapturePack pack = SmallPack();
  for (View& view : pack.capture.views) {
    std::fill(view.photo.pixels.begin(), view.photo.pixels.end(), uint8_t{90});
  }
  const std::vector<uint8_t> even = pack.capture.views[1].photo.pixels;
  Spoil({.blur_views = 1}, pack);
  EXPECT_EQ(pack.capture.views[1].photo.pixels, even);
}

TEST(Spoil, PaintsSomethingThatMovesIntoAShareOfTheTrainingPhotographs) {
  EXPECT_EQ(NumChanged({.mover_views = 1}), 7);
  const int half = NumChanged({.mover_views = 0.5});
  EXPECT_GT(half, 0);
  EXPECT_LT(half, 7);
}

}  // namespace
}  // namespace pepeseg
