#include "core/features/mask_completion.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "core/features/mask_scales.h"
#include "tests/core/features/perception_scene.h"
#include "tests/core/features/wall_capture.h"

namespace pepeseg {
namespace {

using ::pepeseg::testing::WallCapture;
using ::pepeseg::testing::WallPatch;

constexpr WallPatch kLeft = {-0.8, -0.5, -0.2, 0.5}, kRight = {0.2, -0.5, 0.8, 0.5},
                    kTop = {-0.8, -0.9, 0.8, -0.6};

std::vector<CompletedMasks> Complete(const WallCapture& wall,
                                     std::span<const std::vector<float>> scales) {
  return CompleteMasks(wall.capture, wall.reprojection,
                       MeasureMaskAgreement(wall.capture, wall.reprojection), scales);
}

double Iou(const BinaryMask& a, const BinaryMask& b) {
  int both = 0, any = 0;
  for (size_t i = 0; i < a.pixels.size(); ++i) {
    both += (a.pixels[i] & b.pixels[i]) != 0 ? 1 : 0;
    any += (a.pixels[i] | b.pixels[i]) != 0 ? 1 : 0;
  }
  return static_cast<double>(both) / any;
}

TEST(MaskCompletion, AddsTheMaskThatOneViewLacks) {
  const WallCapture wall(
      {{kLeft, kRight, kTop}, {kLeft, kRight, kTop}, {kRight, kTop}, {kLeft, kRight, kTop}});
  std::vector<std::vector<float>> scales = wall.EqualScales(0.7f);
  scales[0][0] = 0.5f;
  scales[3][0] = 0.9f;
  const std::vector<CompletedMasks> completed = Complete(wall, scales);
  for (const size_t whole : {0, 1, 3}) {
    EXPECT_TRUE(completed[whole].masks.empty());
    EXPECT_TRUE(completed[whole].added_scales.empty());
  }
  ASSERT_EQ(completed[2].masks.num_masks, 3);
  const MaskSet& own = wall.capture.views[2].masks;
  for (int mask = 0; mask < own.num_masks; ++mask) {
    EXPECT_EQ(completed[2].masks.Extract(mask).pixels, own.Extract(mask).pixels);
  }
  EXPECT_GT(Iou(completed[2].masks.Extract(2), wall.MaskOf(2, kLeft)), 0.95);
  EXPECT_EQ(completed[2].added_scales, std::vector<float>{0.7f}) << "the median";
}

TEST(MaskCompletion, AddsNothingWhereMasksAgree) {
  const WallCapture wall({{kLeft, kRight}, {kLeft, kRight}, {kLeft, kRight}});
  for (const CompletedMasks& of_view : Complete(wall, wall.EqualScales(1))) {
    EXPECT_TRUE(of_view.added_scales.empty());
  }
}

TEST(MaskCompletion, DoesNotSpreadAMaskThatStandsAlone) {
  const WallCapture wall({{kLeft, kRight}, {kRight}, {kRight}, {kRight}});
  for (const CompletedMasks& of_view : Complete(wall, wall.EqualScales(1))) {
    EXPECT_TRUE(of_view.added_scales.empty());
  }
}

TEST(MaskCompletion, DoesNotSpreadAMaskWithoutAScale) {
  const WallCapture wall({{kLeft, kRight}, {kLeft, kRight}, {kRight}, {kLeft, kRight}});
  std::vector<std::vector<float>> scales = wall.EqualScales(1);
  for (const size_t view : {0, 1, 3}) scales[view][0] = kNoScale;
  for (const CompletedMasks& of_view : Complete(wall, scales)) {
    EXPECT_TRUE(of_view.added_scales.empty());
  }
}

TEST(MaskCompletion, AddsNothingToASingleViewOrWithoutMasks) {
  const WallCapture one({{kLeft}}), none({{}, {}});
  EXPECT_TRUE(Complete(one, one.EqualScales(1))[0].added_scales.empty());
  EXPECT_TRUE(Complete(none, none.EqualScales(1))[0].added_scales.empty());
}

// Returns the mean over views and patches of the best IoU of a patch with a mask of the view.
double MeanRecall(const WallCapture& wall, std::span<const WallPatch> patches,
                  std::span<const CompletedMasks> completed) {
  double sum = 0;
  int count = 0;
  for (size_t view = 0; view < completed.size(); ++view) {
    const MaskSet& masks = completed[view].added_scales.empty() ? wall.capture.views[view].masks
                                                                : completed[view].masks;
    for (const WallPatch& patch : patches) {
      double best = 0;
      for (int mask = 0; mask < masks.num_masks; ++mask) {
        best = std::max(best, Iou(masks.Extract(mask), wall.MaskOf(static_cast<int>(view), patch)));
      }
      sum += best;
      ++count;
    }
  }
  return sum / count;
}

TEST(MaskCompletion, RestoresMostOfThirtyPercentMissingMasks) {
  const std::vector<WallPatch> all = {kLeft, kRight, kTop, {-0.15, -0.5, 0.15, 0.5}};
  std::vector<std::vector<WallPatch>> patches;
  std::mt19937 random(5);
  for (int view = 0; view < 8; ++view) {
    patches.emplace_back();
    for (const WallPatch& patch : all) {
      if (random() % 10 >= 3) patches.back().push_back(patch);
    }
  }
  const WallCapture wall(patches);
  const std::vector<CompletedMasks> nothing(patches.size());
  const std::vector<CompletedMasks> completed = Complete(wall, wall.EqualScales(1));
  EXPECT_LT(MeanRecall(wall, all, nothing), 0.85);
  EXPECT_GT(MeanRecall(wall, all, completed), 0.95);
}

// The depth is rendered here: splats overhang their masks, and surfaces hide each other.
TEST(MaskCompletion, RestoresARemovedMaskAndIsDeterministic) {
  testing::PerceptionScene scene;
  Capture& capture = scene.scene.capture;
  const std::vector<MaskSet> whole = [&] {
    std::vector<MaskSet> masks;
    for (const View& view : capture.views) masks.push_back(view.masks);
    return masks;
  }();
  const int view = scene.reprojection.views()[2];
  const BinaryMask missing = whole[view].Extract(0);
  std::vector<BinaryMask> kept;
  for (int mask = 1; mask < whole[view].num_masks; ++mask)
    kept.push_back(whole[view].Extract(mask));
  capture.views[view].masks = BuildMaskSet(whole[view].width, whole[view].height, kept);
  scene.mask_scales[view].erase(scene.mask_scales[view].begin());
  const auto complete = [&] {
    return CompleteMasks(capture, scene.reprojection,
                         MeasureMaskAgreement(capture, scene.reprojection), scene.mask_scales);
  };
  const std::vector<CompletedMasks> completed = complete(), again = complete();
  ASSERT_EQ(completed[view].added_scales.size(), 1u);
  EXPECT_GT(Iou(completed[view].masks.Extract(completed[view].masks.num_masks - 1), missing), 0.7);
  for (size_t i = 0; i < completed.size(); ++i) {
    EXPECT_EQ(completed[i].masks.pixel_cell, again[i].masks.pixel_cell);
    EXPECT_EQ(completed[i].masks.cell_bits, again[i].masks.cell_bits);
    EXPECT_EQ(completed[i].added_scales, again[i].added_scales);
  }
}

}  // namespace
}  // namespace pepeseg
