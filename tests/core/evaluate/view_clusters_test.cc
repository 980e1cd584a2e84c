#include "core/evaluate/view_clusters.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "tests/core/evaluate/two_blobs.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

constexpr double kFineScale = 0.1;  // at which the blobs have a cosine under -0.5
constexpr size_t kNumPixels = size_t{testing::kTwoBlobsSize} * testing::kTwoBlobsSize;

class ViewClustersTest : public testing::TwoBlobsTest {
 protected:
  const ModelView& view() const { return segmenter_->model().views[0]; }
  // Returns the features of the blobs' Gaussians, [2, 32]: left, right.
  std::vector<float> BlobFeatures() const { return segmenter_->model().field.features; }
};

TEST_F(ViewClustersTest, PutsTheBlobsIntoDifferentClusters) {
  ASSERT_OK_AND_ASSIGN(ViewClusters clusters, ViewClusters::Sample(*segmenter_, view(), 16384));
  ASSERT_OK_AND_ASSIGN(const ScaleClusters* found, clusters.At(kFineScale));
  ASSERT_GE(found->clusters.count, 2);
  EXPECT_EQ(found->centroids.size(), static_cast<size_t>(found->clusters.count) * kFeatureSize);
  ASSERT_EQ(found->clusters.labels.size(), clusters.pixels().size());
  const Mask left = Left(0), right = Right(0);
  std::set<int> of_left, of_right;
  for (size_t i = 0; i < clusters.pixels().size(); ++i) {
    const int label = found->clusters.labels[i];
    if (label == kNoise) continue;
    if (left[clusters.pixels()[i]] != 0) of_left.insert(label);
    if (right[clusters.pixels()[i]] != 0) of_right.insert(label);
  }
  for (const int label : of_left) EXPECT_FALSE(of_right.contains(label)) << label;
}

TEST_F(ViewClustersTest, SamplesNeitherIgnoredPixelsNorThoseThatShowNothing) {
  Mask ignore(kNumPixels);
  for (size_t i = 0; i < ignore.size(); ++i) ignore[i] = i % testing::kTwoBlobsSize >= 48 ? 1 : 0;
  ASSERT_OK_AND_ASSIGN(const ViewClusters all, ViewClusters::Sample(*segmenter_, view(), 16384));
  ASSERT_OK_AND_ASSIGN(const ViewClusters counted,
                       ViewClusters::Sample(*segmenter_, view(), 16384, ignore));
  EXPECT_GT(counted.pixels().size(), 100u);
  EXPECT_LT(counted.pixels().size(), all.pixels().size());
  for (const int32_t pixel : counted.pixels()) EXPECT_EQ(ignore[pixel], 0) << pixel;
  EXPECT_LT(all.pixels().back(), static_cast<int32_t>(kNumPixels) - 2 * testing::kTwoBlobsSize)
      << "the bottom rows show nothing";
}

TEST_F(ViewClustersTest, GivesEachPixelItsNearestCentroid) {
  ASSERT_OK_AND_ASSIGN(const std::vector<int32_t> nearest,
                       NearestCentroids(*segmenter_, view(), BlobFeatures(), kFineScale));
  ASSERT_EQ(nearest.size(), kNumPixels);
  const Mask left = Left(0), right = Right(0);
  for (size_t i = 0; i < nearest.size(); ++i) {
    if (left[i] != 0) {
      EXPECT_EQ(nearest[i], 0) << i;
    }
    if (right[i] != 0) {
      EXPECT_EQ(nearest[i], 1) << i;
    }
  }
  EXPECT_EQ(nearest.back(), kNoise) << "nothing is rendered there";
}

// Twenty centroids take two passes over the view. All but the last two are of a dimension that no
// pixel has, and the last two are equal.
TEST_F(ViewClustersTest, FindsTheNearestOfMoreCentroidsThanFitIntoOnePass) {
  std::vector<float> centroids(size_t{20} * kFeatureSize);
  for (size_t c = 0; c < 18; ++c) centroids[c * kFeatureSize + 5] = 1;
  const std::vector<float> blobs = BlobFeatures();
  for (const size_t c : {18, 19}) {
    std::copy_n(blobs.begin(), kFeatureSize, centroids.begin() + ptrdiff_t(c) * kFeatureSize);
  }
  ASSERT_OK_AND_ASSIGN(const std::vector<int32_t> nearest,
                       NearestCentroids(*segmenter_, view(), centroids, kFineScale));
  const Mask left = Left(0);
  for (size_t i = 0; i < nearest.size(); ++i) {
    if (left[i] != 0) {
      EXPECT_EQ(nearest[i], 18) << i << ": the first among equals";
    }
  }
}

TEST_F(ViewClustersTest, LeavesAllPixelsInNoClusterWithoutCentroids) {
  ASSERT_OK_AND_ASSIGN(const std::vector<int32_t> nearest,
                       NearestCentroids(*segmenter_, view(), {}, kFineScale));
  EXPECT_EQ(nearest, std::vector<int32_t>(kNumPixels, kNoise));
}

}  // namespace
}  // namespace pepeseg
