#include "core/cluster/hdbscan.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <random>
#include <set>

#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

using ::testing::Each;
using ::testing::HasSubstr;

class Cloud {
 public:
  // Adds normally distributed points around (x, y), in the first two of the 32 numbers.
  void AddBlob(int count, double x, double y, double spread) {
    for (int i = 0; i < count; ++i) {
      Add(x + spread * normal_(random_), y + spread * normal_(random_));
    }
  }
  void Add(double x, double y) {
    points.resize(points.size() + kFeatureSize);
    float* at = points.data() + points.size() - kFeatureSize;
    at[0] = static_cast<float>(x);
    at[1] = static_cast<float>(y);
  }
  std::vector<float> points;

 private:
  std::mt19937_64 random_{5};
  std::normal_distribution<double> normal_;
};

Clusters HdbscanOnCpu(const std::vector<float>& points, const HdbscanOptions& options) {
  const std::unique_ptr<Backend> backend = MakeCpuBackend(2);
  absl::StatusOr<Clusters> clusters = Hdbscan(*backend, points, options);
  EXPECT_OK(clusters);
  return clusters.ok() ? *clusters : Clusters();
}

std::set<int> LabelsOf(const Clusters& clusters, int first, int end) {
  return {clusters.labels.begin() + first, clusters.labels.begin() + end};
}

TEST(Hdbscan, FindsBlobsAmongNoise) {
  Cloud cloud;
  cloud.AddBlob(60, 0, 0, 0.3);
  cloud.AddBlob(100, 10, 0, 0.5);
  cloud.AddBlob(40, 0, 10, 0.2);
  for (int i = 0; i < 12; ++i) cloud.Add(-60 + 25.0 * i, 50 + 40 * std::sin(2.0 * i));
  const Clusters clusters = HdbscanOnCpu(cloud.points, {.min_cluster_size = 15, .min_samples = 5});
  EXPECT_EQ(clusters.count, 3);
  EXPECT_THAT(LabelsOf(clusters, 200, 212), std::set<int>{kNoise});
  for (const auto& [label, first, end] :
       {std::tuple(0, 0, 60), std::tuple(1, 60, 160), std::tuple(2, 160, 200)}) {
    const auto begin = clusters.labels.begin();
    EXPECT_GT(std::count(begin + first, begin + end, label), (end - first) * 4 / 5) << label;
    EXPECT_EQ(std::count(begin, begin + first, label) +
                  std::count(begin + end, clusters.labels.end(), label),
              0);
    EXPECT_EQ(
        *std::max_element(clusters.strengths.begin() + first, clusters.strengths.begin() + end), 1);
  }
  for (size_t i = 0; i < clusters.labels.size(); ++i) {
    EXPECT_EQ(clusters.strengths[i] == 0, clusters.labels[i] == kNoise) << i;
  }
}

TEST(Hdbscan, FollowsTwoMoons) {
  Cloud cloud;
  for (int i = 0; i < 100; ++i) {
    const double angle = M_PI * i / 99;
    cloud.Add(std::cos(angle), std::sin(angle));
    cloud.Add(1 - std::cos(angle), 0.5 - std::sin(angle));
  }
  const Clusters clusters = HdbscanOnCpu(cloud.points, {.min_cluster_size = 10, .min_samples = 4});
  EXPECT_EQ(clusters.count, 2);
  for (int i = 0; i < 200; ++i) EXPECT_EQ(clusters.labels[i], i % 2) << i;
}

// Two of three groups are closer to each other than to the third.
TEST(Hdbscan, ChoosesTheMoreStableLevel) {
  const auto labels_with_gap = [](double gap) {
    Cloud cloud;
    cloud.AddBlob(50, 0, 0, 0.2);
    cloud.AddBlob(50, gap, 0, 0.2);
    cloud.AddBlob(50, 40, 0, 0.2);
    return HdbscanOnCpu(cloud.points, {.min_cluster_size = 20, .min_samples = 5}).count;
  };
  EXPECT_EQ(labels_with_gap(0.7), 2);
  EXPECT_EQ(labels_with_gap(10), 3);
}

TEST(Hdbscan, LabelsASingleClusterAsNoise) {
  Cloud blob, ring;
  blob.AddBlob(200, 3, 4, 1);
  for (int i = 0; i < 64; ++i) ring.Add(std::cos(i * M_PI / 32), std::sin(i * M_PI / 32));
  // Two clusters of this size do not fit into 200 points.
  const HdbscanOptions options = {.min_cluster_size = 101, .min_samples = 5};
  EXPECT_THAT(HdbscanOnCpu(blob.points, options).labels, Each(kNoise));
  EXPECT_THAT(HdbscanOnCpu(ring.points, {.min_cluster_size = 10, .min_samples = 3}).labels,
              Each(kNoise));
}

TEST(Hdbscan, LabelsEqualPointsAsNoise) {
  const std::vector<float> points(100 * kFeatureSize, 0.5f);
  const Clusters clusters = HdbscanOnCpu(points, {});
  EXPECT_EQ(clusters.count, 0);
  EXPECT_THAT(clusters.labels, Each(kNoise));
  EXPECT_THAT(clusters.strengths, Each(0));
}

TEST(Hdbscan, SeparatesTwoHeapsOfEqualPoints) {
  Cloud cloud;
  for (int i = 0; i < 30; ++i) cloud.Add(i % 2, 0);
  cloud.Add(5, 0);
  const Clusters clusters = HdbscanOnCpu(cloud.points, {.min_cluster_size = 10, .min_samples = 5});
  EXPECT_EQ(clusters.count, 2);
  for (int i = 0; i < 30; ++i) EXPECT_EQ(clusters.labels[i], i % 2);
  EXPECT_EQ(clusters.labels[30], kNoise);
  EXPECT_EQ(clusters.strengths[0], 1);
}

TEST(Hdbscan, LabelsGroupsBelowTheMinimumSizeAsNoise) {
  Cloud cloud;
  cloud.AddBlob(50, 0, 0, 0.2);
  cloud.AddBlob(50, 10, 0, 0.2);
  cloud.AddBlob(19, 0, 10, 0.1);
  const Clusters clusters = HdbscanOnCpu(cloud.points, {.min_cluster_size = 20, .min_samples = 5});
  EXPECT_EQ(clusters.count, 2);
  EXPECT_THAT(LabelsOf(clusters, 100, 119), std::set<int>{kNoise});
  EXPECT_EQ(HdbscanOnCpu(cloud.points, {.min_cluster_size = 19, .min_samples = 5}).count, 3);
}

// A point halfway between two clusters, as far from either as its core distance, is in neither: the
// order of the points must not decide.
TEST(Hdbscan, LabelsAPointBetweenTwoClustersAsNoise) {
  Cloud cloud;
  for (int i = 0; i < 10; ++i) cloud.Add(i % 5, i < 5 ? 0 : 1);
  cloud.Add(8, 0);
  for (int i = 0; i < 10; ++i) cloud.Add(12 + i % 5, i < 5 ? 0 : 1);
  const Clusters clusters = HdbscanOnCpu(cloud.points, {.min_cluster_size = 10, .min_samples = 3});
  EXPECT_EQ(clusters.count, 2);
  EXPECT_EQ(clusters.labels[0], 0);
  EXPECT_EQ(clusters.labels[10], kNoise);
  EXPECT_EQ(clusters.labels[20], 1);
}

TEST(Hdbscan, DoesNotDependOnTheOrderOfThePoints) {
  Cloud cloud;
  for (int i = 0; i < 6; ++i) cloud.AddBlob(30, 4 * i, i % 3, 0.8);
  for (float& value : cloud.points) value = std::round(4 * value) / 4;  // makes distances equal
  const HdbscanOptions options = {.min_cluster_size = 8, .min_samples = 4};
  const Clusters want = HdbscanOnCpu(cloud.points, options);
  ASSERT_GT(want.count, 2);
  std::vector<int> order(180);
  std::iota(order.begin(), order.end(), 0);
  std::shuffle(order.begin(), order.end(), std::mt19937(3));
  std::vector<float> shuffled(cloud.points.size());
  for (int i = 0; i < 180; ++i) {
    std::copy_n(cloud.points.begin() + order[i] * kFeatureSize, kFeatureSize,
                shuffled.begin() + static_cast<int64_t>(i) * kFeatureSize);
  }
  const Clusters got = HdbscanOnCpu(shuffled, options);
  ASSERT_EQ(got.count, want.count);
  for (int i = 0; i < 180; ++i) {
    EXPECT_EQ(got.labels[i] == kNoise, want.labels[order[i]] == kNoise);
    EXPECT_EQ(got.strengths[i], want.strengths[order[i]]);
    for (int j = 0; j < i; ++j) {
      EXPECT_EQ(got.labels[i] == got.labels[j], want.labels[order[i]] == want.labels[order[j]]);
    }
  }
}

TEST(Hdbscan, NumbersClustersByTheirFirstPoints) {
  Cloud cloud;
  for (int i = 0; i < 60; ++i) cloud.AddBlob(1, i % 3 == 0 ? 20 : 10.0 * (i % 3), 0, 0.1);
  const Clusters clusters = HdbscanOnCpu(cloud.points, {.min_cluster_size = 10, .min_samples = 3});
  int seen = 0;
  for (const int label : clusters.labels) {
    EXPECT_LE(label, seen);
    seen = std::max(seen, label + 1);
  }
  EXPECT_EQ(seen, clusters.count);
}

TEST(Hdbscan, LabelsPointsThatAreNotFiniteAsNoise) {
  Cloud cloud;
  cloud.AddBlob(50, 0, 0, 0.2);
  cloud.AddBlob(50, 10, 0, 0.2);
  const HdbscanOptions options = {.min_cluster_size = 20, .min_samples = 5};
  const Clusters want = HdbscanOnCpu(cloud.points, options);
  for (int i = 0; i < 30; ++i) cloud.Add(std::numeric_limits<double>::quiet_NaN(), i);
  cloud.Add(std::numeric_limits<double>::infinity(), 0);
  Clusters got = HdbscanOnCpu(cloud.points, options);
  EXPECT_THAT(LabelsOf(got, 100, 131), std::set<int>{kNoise});
  got.labels.resize(100);
  EXPECT_EQ(got.labels, want.labels);
}

TEST(Hdbscan, LabelsTooFewPointsAsNoise) {
  Cloud cloud;
  for (int count = 0; count < 10; ++count) {
    EXPECT_THAT(HdbscanOnCpu(cloud.points, {.min_cluster_size = 10, .min_samples = 5}).labels,
                Each(kNoise));
    const Clusters fewer_than_samples =
        HdbscanOnCpu(cloud.points, {.min_cluster_size = 2, .min_samples = 10});
    EXPECT_EQ(fewer_than_samples.labels, std::vector<int>(count, kNoise));
    cloud.Add(count * count, 0);
  }
}

TEST(Hdbscan, ClustersPointsInDeviceMemory) {
  Cloud cloud;
  cloud.AddBlob(50, 0, 0, 0.2);
  cloud.AddBlob(50, 10, 0, 0.2);
  const std::unique_ptr<Backend> backend = MakeCpuBackend(1);
  const Buffer<float> points(*backend, std::span<const float>(cloud.points));
  const auto clusters = Hdbscan(*backend, points.span(), {});
  ASSERT_OK(clusters);
  EXPECT_EQ(clusters->labels, HdbscanOnCpu(cloud.points, {}).labels);
}

TEST(Hdbscan, RefusesBadOptionsAndSizes) {
  const auto message = [](const HdbscanOptions& options) {
    return std::string(Validate(options).message());
  };
  EXPECT_OK(Validate(HdbscanOptions()));
  EXPECT_THAT(message({.min_cluster_size = 1}), HasSubstr("min_cluster_size is 1"));
  EXPECT_THAT(message({.min_samples = 0}), HasSubstr("min_samples is 0"));
  EXPECT_THAT(message({.min_samples = kMaxMinSamples + 1}), HasSubstr("[1, 32]"));
  const std::unique_ptr<Backend> backend = MakeCpuBackend(1);
  const std::vector<float> points(33);
  EXPECT_STATUS(Hdbscan(*backend, points, {}), absl::StatusCode::kInvalidArgument, "33");
}

TEST(ClusterMeans, HaveLengthOneAndLeaveOutNoise) {
  Cloud cloud;
  cloud.Add(3, 0);
  cloud.Add(0, 4);
  cloud.Add(100, 100);
  cloud.Add(0, -2);
  cloud.Add(1, 0);
  cloud.Add(-1, 0);
  const std::vector<float> means =
      ClusterMeans(cloud.points, {3, {0, 0, kNoise, 1, 2, 2}, std::vector<float>(6)});
  ASSERT_EQ(means.size(), 3u * kFeatureSize);
  EXPECT_FLOAT_EQ(means[0], 0.6f);
  EXPECT_FLOAT_EQ(means[1], 0.8f);
  EXPECT_EQ(means[kFeatureSize], 0);
  EXPECT_EQ(means[kFeatureSize + 1], -1);
  EXPECT_EQ(means[2 * kFeatureSize], 0);
}

}  // namespace
}  // namespace pepeseg
