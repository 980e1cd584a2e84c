// Refinement of Gaussians whose result can be computed by hand.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "tests/kernels/backend_test.h"
#include "tests/kernels/refined.h"

namespace pepeseg {
namespace {

constexpr float kDepth = 2;

// A camera at the origin that looks along z: an image of 100 x 40 with 50 pixels to a scene unit at
// kDepth.
PinholeView FrontView() {
  PinholeView view;
  view.width = 100;
  view.height = 40;
  view.fx = view.fy = 100;
  view.cx = 50;
  view.cy = 20.5f;
  for (int k = 0; k < 3; ++k) view.cam_from_world[5 * k] = 1;
  return view;
}

// A Gaussian that is long along x.
struct Needle {
  float x = 50;     // of the mean, pixels
  float half = 30;  // 3 standard deviations along x, pixels
  float opacity_logit = 4;
};

HostGaussians Needles(const std::vector<Needle>& needles) {
  HostGaussians scene{static_cast<int64_t>(needles.size()), 0, {}};
  scene.planes.resize(scene.count * NumPlanes(0));
  for (int64_t i = 0; i < scene.count; ++i) {
    scene.At(kMeanPlane, i) = (needles[i].x - 50) / 50;
    scene.At(kMeanPlane + 2, i) = kDepth;
    scene.At(kLogScalePlane, i) = std::log(needles[i].half / 150);
    for (int k = 1; k < 3; ++k) scene.At(kLogScalePlane + k, i) = std::log(0.002f);
    scene.At(kRotationPlane, i) = 1;
    scene.At(kOpacityPlane, i) = needles[i].opacity_logit;
  }
  return scene;
}

// A mask of the columns [first, end).
std::vector<uint8_t> Columns(int first, int end) {
  return MaskWhere(FrontView(), [=](int x, int) { return x >= first && x < end; });
}

// Returns the ends of a needle on screen, pixels.
std::pair<double, double> Ends(const HostGaussians& scene, int64_t i) {
  const double x = 50 + 50 * double{scene.At(kMeanPlane, i)};
  const double half = 150 * std::exp(double{scene.At(kLogScalePlane, i)});
  return {x - half, x + half};
}

class RefineTest : public BackendTest {
 protected:
  Refined Run(const HostGaussians& scene, const MaskImages& masks, bool split = false) {
    Refined refined(*backend_, scene, FrontView(), masks);
    RefineGaussiansArgs args = refined.MakeArgs();
    args.split = split;
    backend_->RefineGaussians(args);
    return refined;
  }
  void ExpectEnds(const Needle& needle, const MaskImages& masks, std::pair<double, double> want) {
    const Refined refined = Run(Needles({needle}), masks);
    const auto [first, last] = Ends(refined.Result(), 0);
    EXPECT_NEAR(first, want.first, 1e-3);
    EXPECT_NEAR(last, want.second, 1e-3);
    EXPECT_EQ(refined.Count(kNumRefineRanked), 1);
    EXPECT_EQ(refined.Count(kNumRefineCandidates), 1);
    EXPECT_EQ(refined.Count(kNumRefined), 1);
    EXPECT_EQ(refined.Count(kNumRefineSplit), 0);
  }
  void ExpectUntouched(const HostGaussians& scene, const MaskImages& masks) {
    const Refined refined = Run(scene, masks);
    EXPECT_EQ(refined.Result().planes, scene.planes);
    EXPECT_EQ(refined.Count(kNumRefined), 0);
    EXPECT_THAT(Download(refined.refinable), ::testing::Each(1));
    EXPECT_THAT(Download(refined.rendered.moment1), ::testing::Each(7));
    EXPECT_THAT(Download(refined.rendered.num_steps), ::testing::Each(7));
  }
};
INSTANTIATE_TEST_SUITE_P(Backends, RefineTest, AllBackends(), BackendName);

TEST_P(RefineTest, ShortensTheAxisToWhatLiesInTheMask) {
  ExpectEnds({}, {Columns(0, 60)}, {20, 60});
  ExpectEnds({}, {Columns(47, 100)}, {47, 80});
  ExpectEnds({.x = 50.3f}, {Columns(33, 100)}, {33, 80.3});
}

TEST_P(RefineTest, ResetsTheMomentsOfWhatItRefines) {
  const Refined refined = Run(Needles({{.half = 6}, {}}), {Columns(0, 60)});
  EXPECT_THAT(Download(refined.refinable), ::testing::ElementsAre(1, 0));
  EXPECT_THAT(Download(refined.rendered.num_steps), ::testing::ElementsAre(7, 0));
  for (const Buffer<float>* moments : {&refined.rendered.moment1, &refined.rendered.moment2}) {
    const std::vector<float> host = Download(*moments);
    for (size_t k = 0; k < host.size(); k += 2) {
      ASSERT_EQ(host[k], 7);
      ASSERT_EQ(host[k + 1], 0);
    }
  }
}

TEST_P(RefineTest, TakesTheSmallestMaskThatTheAxisCrosses) {
  ExpectEnds({}, {Columns(0, 60), Columns(0, 45), Columns(30, 40)}, {20, 45});
  // In a mask of several pieces the first exit counts.
  auto pieces = Columns(0, 60);
  for (size_t i = 0; i < pieces.size(); ++i) pieces[i] &= i % 100 < 35 || i % 100 >= 40;
  ExpectEnds({}, {pieces}, {20, 35});
}

TEST_P(RefineTest, ReadsEveryWordOfTheBitsets) {
  MaskImages masks(130, Columns(0, 100));  // no axis crosses these
  masks[129] = Columns(0, 60);
  masks[70] = Columns(0, 55);
  ExpectEnds({}, masks, {20, 55});
}

TEST_P(RefineTest, LeavesATwentiethOfTheAxisAtLeast) {
  ExpectEnds({}, {Columns(18, 21)}, {20, 23});
}

TEST_P(RefineTest, FollowsTheAxisToTheEdgeOfTheImage) {
  ExpectEnds({.x = 90}, {Columns(75, 100)}, {75, 120});
  ExpectEnds({.x = 90}, {Columns(0, 75)}, {60, 75});
  ExpectEnds({.x = 10}, {Columns(0, 25)}, {-20, 25});
  ExpectUntouched(Needles({{.half = 75}}), {Columns(0, 60)});  // leaves the image at both ends
}

TEST_P(RefineTest, LeavesAloneWhatCrossesNothing) {
  ExpectUntouched(Needles({{}}), {Columns(0, 100)});
  ExpectUntouched(Needles({{}}), {Columns(0, 10), Columns(90, 100)});
  ExpectUntouched(Needles({{}}), {Columns(40, 60)});  // both ends are outside the mask
  ExpectUntouched(Needles({{}}), {});
  ExpectUntouched(Needles({{.x = 120}, {.x = -20}}),
                  {Columns(0, 97)});  // the means are outside the image
}

TEST_P(RefineTest, LeavesAloneHalfAxesBelowAPixel) {
  ExpectUntouched(Needles({{.half = 0.98f}}), {Columns(0, 50)});
  ExpectEnds({.half = 1.25f}, {Columns(0, 50)}, {48.75, 50});
}

TEST_P(RefineTest, LeavesAloneAnAxisThatNoneInSpaceCarries) {
  HostGaussians scene = Needles({{}});
  // Two equal axes at 45 degrees to the image: each carries 0.71 of the axis on screen.
  scene.At(kLogScalePlane + 2, 0) = scene.At(kLogScalePlane, 0);
  scene.At(kRotationPlane, 0) = std::cos(std::acos(-1.0f) / 8);
  scene.At(kRotationPlane + 2, 0) = std::sin(std::acos(-1.0f) / 8);
  ExpectUntouched(scene, {Columns(0, 60)});
}

TEST_P(RefineTest, LeavesAloneWhereTheDepthIsUnknown) {
  ExpectUntouched(Needles({{.opacity_logit = -0.1f}}), {Columns(0, 60)});
  ExpectEnds({.opacity_logit = 0.1f}, {Columns(0, 60)}, {20, 60});
}

// Of 20 refinable Gaussians at the same place, 29 % are 5.8, so 5: those with the lowest indices.
TEST_P(RefineTest, TakesTheFirstOfEqualDistances) {
  const HostGaussians scene = Needles(std::vector<Needle>(21));
  Refined refined(*backend_, scene, FrontView(), {Columns(0, 60)});
  std::vector<int32_t> refinable(21, 1);
  refinable[1] = 0;
  refined.refinable.Upload(refinable);
  RefineGaussiansArgs args = refined.MakeArgs();
  args.candidate_share = 0.29;
  backend_->RefineGaussians(args);
  EXPECT_EQ(refined.Count(kNumRefineRanked), 20);
  EXPECT_EQ(refined.Count(kNumRefineCandidates), 5);
  EXPECT_EQ(refined.Count(kNumRefined), 5);
  for (int64_t i = 0; i < 21; ++i) EXPECT_EQ(refined.WasRefined(i), i < 6) << i;
}

TEST_P(RefineTest, ChangesNothingWithoutCandidates) {
  const HostGaussians scene = Needles({{}, {}, {}});
  Refined refined(*backend_, scene, FrontView(), {Columns(0, 60)});
  RefineGaussiansArgs args = refined.MakeArgs();
  args.candidate_share = 0.3;  // 0.3 of 3 rounds down to none
  args.split = true;
  backend_->RefineGaussians(args);
  EXPECT_THAT(Download(refined.counts), ::testing::ElementsAre(3, 0, 0, 0));
  refined.refinable.Zero();
  args.candidate_share = 1;
  backend_->RefineGaussians(args);
  EXPECT_THAT(Download(refined.counts), ::testing::ElementsAre(0, 0, 0, 0));
  EXPECT_EQ(refined.Result().planes, scene.planes);
}

TEST_P(RefineTest, ChangesNothingInAnEmptyView) {
  ExpectUntouched(Needles({{.x = 4000}}), {Columns(0, 60)});
}

TEST_P(RefineTest, IgnoresDegenerateGaussians) {
  HostGaussians scene = Needles({{}, {}, {}, {}, {}});
  const float nan = std::numeric_limits<float>::quiet_NaN();
  // Gaussians 0 to 3 are degenerate, 4 is refined.
  scene.At(kMeanPlane, 0) = nan;
  scene.At(kLogScalePlane, 1) = nan;
  scene.At(kLogScalePlane, 2) = 90;
  scene.At(kRotationPlane, 3) = 0;
  const Refined refined = Run(scene, {Columns(0, 60)}, true);
  EXPECT_THAT(Download(refined.refinable), ::testing::ElementsAre(1, 1, 1, 1, 0));
  EXPECT_EQ(refined.Count(kNumRefineSplit), 1);
  const auto [first, last] = Ends(refined.Result(), 4);
  EXPECT_NEAR(first, 20, 1e-3);
  EXPECT_NEAR(last, 60, 1e-3);
}

TEST_P(RefineTest, AddsTheOutsidePartsWhenSplitting) {
  const Refined refined =
      Run(Needles({{}, {.half = 5}, {.x = 56}, {.x = 89.5f}}), {Columns(0, 60)}, true);
  EXPECT_EQ(refined.Count(kNumRefined), 3);
  // The last needle has 59.5 of its 60 pixels outside; its part inside is raised to one twentieth.
  ASSERT_EQ(refined.Count(kNumRefineSplit), 3);
  const std::vector<int32_t> source = Download(refined.outside_source);
  EXPECT_THAT(std::vector(source.begin(), source.begin() + 3), ::testing::ElementsAre(0, 2, 3));
  HostGaussians outside{4, 0, Download(refined.outside_shape)};
  const double want[][2] = {{60, 80}, {60, 86}, {62.5, 119.5}};
  for (int k = 0; k < 3; ++k) {
    const auto [first, last] = Ends(outside, k);
    EXPECT_NEAR(first, want[k][0], 1e-3) << k;
    EXPECT_NEAR(last, want[k][1], 1e-3) << k;
    EXPECT_EQ(outside.At(kMeanPlane + 2, k), kDepth);
    EXPECT_EQ(outside.At(kLogScalePlane + 1, k), std::log(0.002f));
  }
}

TEST_P(RefineTest, LeavesOutAShortOutsidePart) {
  const Refined refined = Run(Needles({{}}), {Columns(0, 78)}, true);
  EXPECT_EQ(refined.Count(kNumRefined), 1);
  EXPECT_EQ(refined.Count(kNumRefineSplit), 0);
}

TEST_P(RefineTest, StopsSplittingAtTheCapacity) {
  Refined refined(*backend_, Needles({{}, {.x = 51}, {.x = 52}}), FrontView(), {Columns(0, 60)});
  RefineGaussiansArgs args = refined.MakeArgs();
  args.split = true;
  args.outside_source = refined.outside_source.span().Subspan(0, 2);
  args.outside_shape = refined.outside_shape.span().Subspan(0, 12);
  backend_->RefineGaussians(args);
  EXPECT_EQ(refined.Count(kNumRefined), 3);
  EXPECT_EQ(refined.Count(kNumRefineSplit), 2);
  EXPECT_THAT(Download(refined.outside_source), ::testing::ElementsAre(0, 1, 0));
  args.outside_source = {};
  args.outside_shape = {};
  refined.refinable.Upload(std::vector<int32_t>(3, 1));
  backend_->RefineGaussians(args);
  EXPECT_EQ(refined.Count(kNumRefineSplit), 0);
}

}  // namespace
}  // namespace pepeseg
