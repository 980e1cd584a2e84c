#include "core/features/centroid_term.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <memory>
#include <set>
#include <vector>

#include "core/features/checkpoint.h"
#include "kernels/buffer.h"
#include "tests/core/features/blob_scene.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

// Returns a unit vector along axis k, rotated by `angle` towards the last axis.
std::vector<float> Direction(int k, double angle) {
  std::vector<float> direction(32);
  direction[k] = static_cast<float>(std::cos(angle));
  direction[31] = static_cast<float>(std::sin(angle));
  return direction;
}

TEST(CentroidBank, AddsNewClustersAndMovesTheCentroidsOfKnownOnes) {
  CentroidBank bank(0.9f);
  bank.Merge(Direction(0, 0));
  bank.Merge(Direction(1, 0));
  ASSERT_EQ(bank.centroids().size(), 2u * 32);
  bank.Merge(Direction(1, 0.3));  // cosine 0.955
  ASSERT_EQ(bank.centroids().size(), 2u * 32);
  const double x = 0.9 + 0.1 * std::cos(0.3), y = 0.1 * std::sin(0.3), length = std::hypot(x, y);
  EXPECT_NEAR(bank.centroids()[32 + 1], x / length, 1e-6);
  EXPECT_NEAR(bank.centroids()[32 + 31], y / length, 1e-6);
  EXPECT_EQ(bank.centroids()[0], 1);
  bank.Merge(Direction(1, 0.6));  // too far: a new centroid
  EXPECT_EQ(bank.centroids().size(), 3u * 32);
}

TEST(CentroidBank, LeavesOutTheMeanOfPixelsThatShowNothing) {
  CentroidBank bank(0.9f);
  std::vector<float> means(32);
  const std::vector<float> shown = Direction(0, 0);
  means.insert(means.end(), shown.begin(), shown.end());
  bank.Merge(means);
  EXPECT_EQ(bank.centroids(), shown);
}

// HDBSCAN has found the clusters of one view to be apart, however close they are.
TEST(CentroidBank, DoesNotMergeClustersOfOneView) {
  CentroidBank bank(0.9f);
  std::vector<float> two = Direction(0, 0);
  const std::vector<float> near = Direction(0, 0.1);
  two.insert(two.end(), near.begin(), near.end());
  bank.Merge(two);
  EXPECT_EQ(bank.centroids().size(), 2u * 32);
}

// Scales at which a label has the finest mask alone, and all masks.
constexpr float kFinest = 0, kAll = std::numeric_limits<float>::infinity();

// An image of 12 x 1 pixels. One mask covers pixels 0..9, and two parts of it cover 0..4 and 5..9.
// No mask covers pixels 10 and 11.
struct Scanline {
  Scanline() {
    std::vector<BinaryMask> masks(3);
    for (int x = 0; x < 12; ++x) {
      masks[0].pixels.push_back(x < 10 ? 1 : 0);
      masks[1].pixels.push_back(x < 5 ? 1 : 0);
      masks[2].pixels.push_back(x >= 5 && x < 10 ? 1 : 0);
      pixels.push_back(x);
    }
    set = BuildMaskSet(12, 1, masks);
  }
  Clusters Keep(const std::vector<int>& labels, int count, float scale) const {
    return KeepAgreeing({count, labels, std::vector<float>(12)}, set, pixels, scales, scale);
  }
  MaskSet set;
  std::vector<int32_t> pixels;
  std::vector<float> scales = {2, 1, 1};
};

TEST(KeepAgreeing, DropsAClusterOfTwoPartsAtTheFineScaleOnly) {
  const Scanline scanline;
  const std::vector<int> whole = {0, 0, 0, 0, 0, 0, 0, 0, 0, 0, -1, -1};
  EXPECT_EQ(scanline.Keep(whole, 1, kFinest).count, 0);
  EXPECT_EQ(scanline.Keep(whole, 1, kFinest).labels, std::vector<int>(12, kNoise));
  EXPECT_EQ(scanline.Keep(whole, 1, kAll).count, 1);
  EXPECT_EQ(scanline.Keep(whole, 1, kAll).labels, whole);
}

TEST(KeepAgreeing, KeepsTheOrderOfTheRemainingClusters) {
  const Scanline scanline;
  // Cluster 1 has half of either part, cluster 2 only pixels of the second part.
  const Clusters kept = scanline.Keep({1, 1, 0, 0, -1, 1, 1, 2, 2, 2, 2, 0}, 3, kFinest);
  EXPECT_EQ(kept.count, 2);
  EXPECT_EQ(kept.labels, (std::vector<int>{-1, -1, 0, 0, -1, -1, -1, 1, 1, 1, 1, 0}));
}

TEST(KeepAgreeing, IgnoresPixelsWithoutALabel) {
  const Scanline scanline;
  const Clusters kept = scanline.Keep({-1, -1, -1, -1, 0, -1, -1, -1, -1, -1, 0, 0}, 1, kFinest);
  EXPECT_EQ(kept.count, 1);
  EXPECT_EQ(scanline.Keep({-1, -1, -1, -1, -1, -1, -1, -1, -1, -1, 0, 0}, 1, kAll).count, 1);
}

constexpr float kCosineOfAxis = 0.9f;

// Refreshes the centroids of a scene once, where the feature of Gaussian k is the direction of axis
// k. Returns the axes that a centroid of the upper scale is along, or -1 for one along none.
std::set<int> CentroidAxes(const testing::BlobScene& scene, const FeatureOptions& options) {
  const auto backend = MakeCpuBackend(1);
  Renderer renderer(*backend, scene.gaussians, 1);
  const std::vector<const MaskSet*> masks = OwnMasks(scene.capture);
  std::vector<std::vector<float>> scales;
  for (const MaskSet* of_view : masks) scales.emplace_back(of_view->num_masks, 1.0f);
  const std::vector<DrawableView> views = MakeDrawableViews(scene.capture, masks, scales);
  std::vector<float> directions;
  for (int k = 0; k < scene.gaussians.count; ++k) {
    const std::vector<float> direction = Direction(k, 0);
    directions.insert(directions.end(), direction.begin(), direction.end());
  }
  const Buffer<float> features(*backend, std::span<const float>(directions));
  CentroidTerm term(*backend, scene.capture, renderer, views, options);
  EXPECT_OK(term.Refresh(features.span(), std::vector<float>(kGateSize)));
  const std::vector<float> centroids = term.Save().upper;
  std::set<int> axes;
  for (size_t i = 0; i < centroids.size(); i += kFeatureSize) {
    int axis = -1;
    for (int k = 0; k < kFeatureSize; ++k) {
      if (centroids[i + k] > kCosineOfAxis) axis = k;
    }
    axes.insert(axis);
  }
  return axes;
}

TEST(CentroidTerm, ClustersPixelsWithoutAMaskOnlyIfNotMaskedOnly) {
  const testing::BlobScene scene({{{24, 24, true}, {72, 24, true}, {48, 72, false}}});
  FeatureOptions options;
  options.centroid_masked_only = true;
  EXPECT_EQ(CentroidAxes(scene, options), (std::set<int>{0, 1}));
  options.centroid_masked_only = false;
  EXPECT_EQ(CentroidAxes(scene, options), (std::set<int>{0, 1, 2}));
}

// Each view alone has two of the four blobs.
TEST(CentroidTerm, ClustersAsManyRandomViewsAsAsked) {
  const testing::BlobScene scene(
      {{{24, 48, true}, {72, 48, true}}, {{24, 48, true}, {72, 48, true}}});
  const std::set<int> first = {0, 1}, second = {2, 3}, both = {0, 1, 2, 3};
  FeatureOptions options;
  options.centroid_views = 1;
  std::set<std::set<int>> found;
  for (options.seed = 1; options.seed <= 20; ++options.seed) {
    found.insert(CentroidAxes(scene, options));
  }
  EXPECT_EQ(found, (std::set<std::set<int>>{first, second}));
  options.centroid_views = 20;
  EXPECT_EQ(CentroidAxes(scene, options), both);
}

}  // namespace
}  // namespace pepeseg
