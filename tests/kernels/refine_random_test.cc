// Compares the refinement of random scenes with the reference.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "tests/kernels/backend_test.h"
#include "tests/kernels/refine_reference.h"

namespace pepeseg {
namespace {

// Random Gaussians, many of them long and thin.
HostGaussians RandomNeedles() {
  RandomSceneOptions options;
  options.count = 1500;
  options.sh_degree = 1;
  options.min_scale = 0.005f;
  options.max_scale = 0.15f;
  return RandomScene(options);
}

// Two objects, two parts inside one of them, and a chessboard of more masks than a word has bits.
MaskImages SomeMasks(const PinholeView& view) {
  MaskImages masks;
  masks.push_back(MaskWhere(view, [](int x, int y) { return x < 50 && y < 60; }));
  masks.push_back(MaskWhere(view, [](int x, int y) { return x >= 55 && x + y < 120; }));
  masks.push_back(MaskWhere(
      view, [](int x, int y) { return (x - 25) * (x - 25) + (y - 30) * (y - 30) < 200; }));
  masks.push_back(MaskWhere(view, [](int x, int y) { return x < 20 && y > 40 && y < 60; }));
  for (int k = 0; k < 96; ++k) {
    masks.push_back(
        MaskWhere(view, [=](int x, int y) { return x / 6 == 2 * (k % 8) + 1 && y / 6 == k / 8; }));
  }
  return masks;
}

class RefineRandomTest : public BackendTest {
 protected:
  void SetUp() override {
    BackendTest::SetUp();
    view_ = TestView(96, 72);
    masks_ = SomeMasks(view_);
    scene_ = RandomNeedles();
  }
  Refined Run(double candidate_share, bool split) {
    Refined refined(*backend_, scene_, view_, masks_);
    RefineGaussiansArgs args = refined.MakeArgs();
    args.candidate_share = candidate_share;
    args.split = split;
    backend_->RefineGaussians(args);
    return refined;
  }

  PinholeView view_;
  MaskImages masks_;
  HostGaussians scene_;
};
INSTANTIATE_TEST_SUITE_P(Backends, RefineRandomTest, AllBackends(), BackendName);

// Returns distance to the rendered depth, in double, and index of the Gaussians for which the
// rendered depth is known, nearest first.
std::vector<std::pair<double, int64_t>> Ranked(const Refined& refined) {
  const auto gaussians = Download(refined.rendered.scratch.visible_gaussian);
  const auto splats = Download(refined.rendered.scratch.visible_splat);
  const auto alpha = Download(refined.rendered.alpha), depth = Download(refined.rendered.depth);
  const PinholeView& view = refined.rendered.view;
  std::vector<std::pair<double, int64_t>> ranked;
  for (size_t v = 0; v < gaussians.size(); ++v) {
    const double x = splats[v].x, y = splats[v].y;
    if (x < 0 || y < 0 || x >= view.width || y >= view.height) continue;
    const int64_t pixel = static_cast<int64_t>(y) * view.width + static_cast<int64_t>(x);
    if (alpha[pixel] <= 0.5f) continue;
    const double rendered = double{depth[pixel]} / alpha[pixel];
    ranked.emplace_back(std::abs(rendered - splats[v].depth), gaussians[v]);
  }
  std::sort(ranked.begin(), ranked.end());
  return ranked;
}

TEST_P(RefineRandomTest, MatchesTheReference) {
  const Refined refined = Run(1, false);
  const HostGaussians result = refined.Result();
  const auto ranked = Ranked(refined);
  EXPECT_EQ(refined.Count(kNumRefineRanked), static_cast<int64_t>(ranked.size()));
  EXPECT_EQ(refined.Count(kNumRefineCandidates), static_cast<int64_t>(ranked.size()));
  int64_t num_refined = 0, num_compared = 0;
  for (const auto& [gap, i] : ranked) {
    num_refined += refined.WasRefined(i);
    const ReferenceRefinement want = RefineReference(scene_, i, view_, masks_);
    // Rounding may decide a close call either way.
    if (want.close_call) continue;
    ++num_compared;
    ASSERT_EQ(refined.WasRefined(i), want.refined) << i;
    if (!want.refined) continue;
    const int plane = kLogScalePlane + want.axis;
    const double share = std::exp(double{result.At(plane, i)} - scene_.At(plane, i));
    EXPECT_NEAR(share, want.share, 0.02) << i;  // the reference walks in steps of 0.01 pixels
    for (int k = 0; k < 3; ++k) {
      EXPECT_NEAR(result.At(k, i) - scene_.At(k, i), (1 - share) * want.to_end[k], 2e-6) << i;
      if (k != want.axis) {
        EXPECT_EQ(result.At(kLogScalePlane + k, i), scene_.At(kLogScalePlane + k, i));
      }
    }
    for (int k = kRotationPlane; k < NumPlanes(1); ++k) {
      ASSERT_EQ(result.At(k, i), scene_.At(k, i));
    }
  }
  EXPECT_EQ(refined.Count(kNumRefined), num_refined);
  EXPECT_GT(num_refined, 300);
  EXPECT_GT(num_compared, static_cast<int64_t>(ranked.size()) / 2);
}

TEST_P(RefineRandomTest, TakesTheNearestToTheRenderedDepthAsCandidates) {
  const Refined all = Run(1, false), some = Run(0.1, false);
  const auto ranked = Ranked(some);
  const auto num_candidates = static_cast<size_t>(0.1 * static_cast<double>(ranked.size()));
  ASSERT_GT(num_candidates, 60u);
  // Otherwise rounding could exchange the last candidate.
  ASSERT_GT(ranked[num_candidates].first - ranked[num_candidates - 1].first, 2e-6);
  EXPECT_EQ(some.Count(kNumRefineCandidates), static_cast<int64_t>(num_candidates));
  std::vector<bool> candidate(scene_.count);
  for (size_t k = 0; k < num_candidates; ++k) candidate[ranked[k].second] = true;
  const HostGaussians after_all = all.Result(), after_some = some.Result();
  for (int64_t i = 0; i < scene_.count; ++i) {
    ASSERT_EQ(some.WasRefined(i), candidate[i] && all.WasRefined(i)) << i;
    const HostGaussians& want = candidate[i] ? after_all : scene_;
    for (int k = 0; k < NumPlanes(1); ++k) ASSERT_EQ(after_some.At(k, i), want.At(k, i)) << i;
  }
}

TEST_P(RefineRandomTest, SplitsIntoPartsThatMeetAtTheBorder) {
  const Refined refined = Run(1, true);
  const HostGaussians inside = refined.Result();
  const int64_t num_split = refined.Count(kNumRefineSplit);
  // Splitting does not change the parts inside.
  EXPECT_EQ(inside.planes, Run(1, false).Result().planes);
  ASSERT_GT(num_split, 250);
  ASSERT_LE(num_split, refined.Count(kNumRefined));
  const std::vector<int32_t> source = Download(refined.outside_source);
  const HostGaussians outside{scene_.count, 0, Download(refined.outside_shape)};
  for (int64_t n = 0; n < num_split; ++n) {
    const int64_t i = source[n];
    ASSERT_TRUE(n == 0 || source[n - 1] < i);
    ASSERT_TRUE(refined.WasRefined(i));
    for (int k = kLogScalePlane; k < kRotationPlane; ++k) {
      const double both = std::exp(double{inside.At(k, i)}) + std::exp(double{outside.At(k, n)});
      const double whole = std::exp(double{scene_.At(k, i)});
      const bool is_cut = inside.At(k, i) != scene_.At(k, i);
      EXPECT_NEAR(both / whole, is_cut ? 1 : 2, 1e-5);
      if (!is_cut) continue;
      // The distance of the means is half of the whole 6-sigma segment.
      double squared = 0;
      for (int c = 0; c < 3; ++c) {
        squared += std::pow(double{inside.At(c, i)} - outside.At(c, n), 2);
      }
      EXPECT_NEAR(std::sqrt(squared) / whole, 3, 2e-4);
    }
  }
}

TEST_P(RefineRandomTest, GivesTheSameBytesEachTime) {
  const Refined a = Run(0.3, true), b = Run(0.3, true);
  EXPECT_EQ(a.Result().planes, b.Result().planes);
  EXPECT_EQ(Download(a.outside_source), Download(b.outside_source));
  EXPECT_EQ(Download(a.outside_shape), Download(b.outside_shape));
}

}  // namespace
}  // namespace pepeseg
