#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/kernels/backend_test.h"
#include "tests/kernels/reference_renderer.h"
#include "tests/kernels/rendered.h"

// The forward pass against the reference renderer.

namespace pepeseg {
namespace {

class RenderTest : public BackendTest {};
INSTANTIATE_TEST_SUITE_P(Backends, RenderTest, AllBackends(), BackendName);

// Difference of an image from the reference.
struct Difference {
  double largest = 0;        // among the pixels without a close call
  double largest_close = 0;  // among the others
  double mean = 0;           // signed, over all pixels; nearly 0 for an unbiased renderer
  double close_share = 0;    // share of the pixels with a close call
};

// Compares values of one or three channels; close_call has one value for each pixel.
Difference Compare(const std::vector<float>& got, const std::vector<double>& want,
                   const std::vector<uint8_t>& close_call) {
  Difference out;
  for (size_t i = 0; i < want.size(); ++i) {
    const bool close = close_call[i % close_call.size()] != 0;
    double& largest = close ? out.largest_close : out.largest;
    largest = std::max(largest, std::abs(got[i] - want[i]));
    out.mean += (got[i] - want[i]) / static_cast<double>(want.size());
    out.close_share += close / static_cast<double>(want.size());
  }
  return out;
}

// Renders the scene with the reference.
ReferenceImage Reference(const Rendered& scene) {
  const std::vector<float>& planes = scene.host.planes;
  ReferenceOptions options;
  options.near_plane = scene.near_plane;
  options.inverse_depth = scene.inverse_depth;
  return RenderReference({scene.host.count, scene.host.sh_degree, {planes.begin(), planes.end()}},
                         scene.view, options);
}

// Renders and compares with the reference. Pixels with a close call may differ by one skipped
// splat: 1/255 of the largest colour or depth, or 1e-4 of it at the end of the transmittance.
void ExpectMatchesReference(Rendered& scene) {
  scene.Render();
  const ReferenceImage want = Reference(scene);
  const auto color = Compare(Download(scene.color), want.color, want.close_call);
  EXPECT_LT(color.largest, 2e-5);
  EXPECT_LT(color.largest_close, 3.0 / 255);
  EXPECT_LT(std::abs(color.mean), 2e-5);
  EXPECT_LT(color.close_share, 0.25);
  const auto alpha = Compare(Download(scene.alpha), want.alpha, want.close_call);
  EXPECT_LT(alpha.largest, 1e-5);
  EXPECT_LT(alpha.largest_close, 1.5 / 255);
  const auto depth = Compare(Download(scene.depth), want.depth, want.close_call);
  EXPECT_LT(depth.largest, 1e-4);
  EXPECT_LT(depth.largest_close, 6.0 / 255);
}

TEST_P(RenderTest, MatchesReference) {
  for (const uint64_t seed : {1, 2, 3}) {
    Rendered scene(*backend_, RandomScene({.count = 300, .seed = seed}), TestView(97, 61));
    ExpectMatchesReference(scene);
  }
}

TEST_P(RenderTest, MatchesReferenceAtEverySphericalHarmonicsDegree) {
  for (const int degree : {0, 1, 2, 3}) {
    Rendered scene(*backend_, RandomScene({.count = 100, .sh_degree = degree}), TestView(48, 32));
    ExpectMatchesReference(scene);
  }
}

// Long thin Gaussians test the reach of splats and the conic's precision.
TEST_P(RenderTest, MatchesReferenceWithNeedles) {
  HostGaussians needles = RandomScene({.count = 200, .seed = 4});
  for (int64_t i = 0; i < needles.count; ++i) {
    needles.At(kLogScalePlane, i) = std::log(0.5f);
    needles.At(kLogScalePlane + 1, i) = std::log(0.002f);
    needles.At(kLogScalePlane + 2, i) = std::log(0.003f);
  }
  Rendered scene(*backend_, needles, TestView(128, 80));
  ExpectMatchesReference(scene);
}

// Pixels stop early behind nearly opaque Gaussians.
TEST_P(RenderTest, MatchesReferenceBehindOpaqueWalls) {
  Rendered scene(*backend_,
                 RandomScene({.count = 800,
                              .min_scale = 0.1f,
                              .max_scale = 0.4f,
                              .min_opacity_logit = 2,
                              .max_opacity_logit = 8}),
                 TestView(64, 48));
  ExpectMatchesReference(scene);
}

TEST_P(RenderTest, MatchesReferenceWithInverseDepthAndChangesNothingElse) {
  Rendered plain(*backend_, RandomScene({.count = 300, .seed = 2}), TestView(97, 61));
  plain.Render();
  Rendered scene(*backend_, RandomScene({.count = 300, .seed = 2}), TestView(97, 61));
  scene.inverse_depth = true;
  ExpectMatchesReference(scene);
  EXPECT_EQ(Download(scene.color), Download(plain.color));
  EXPECT_EQ(Download(scene.alpha), Download(plain.alpha));
  EXPECT_EQ(Download(scene.scratch.entry_visible), Download(plain.scratch.entry_visible));
  EXPECT_NE(Download(scene.depth), Download(plain.depth));
}

TEST_P(RenderTest, CountsWhatTheScratchHolds) {
  Rendered scene(*backend_, RandomScene({.count = 300}), TestView(97, 61));
  scene.Render();
  EXPECT_EQ(scene.Counter(kNumVisible), scene.scratch.visible_gaussian.size());
  EXPECT_EQ(scene.Counter(kNumTileEntries), scene.scratch.entry_visible.size());
  EXPECT_EQ(scene.Counter(kNumTileEntries), Download(scene.scratch.tile_first_entry).back());
  EXPECT_EQ(scene.Counter(kNumCulledDegenerate), 0);
  const auto visible = Download(scene.scratch.visible_gaussian);
  EXPECT_TRUE(std::is_sorted(visible.begin(), visible.end()));
}

}  // namespace
}  // namespace pepeseg
