// Against the naive implementation, on many small inputs.
#include <gtest/gtest.h>

#include <random>

#include "core/cluster/hdbscan.h"
#include "tests/core/cluster/naive_hdbscan.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

struct Input {
  int count, num_channels, num_groups;
  double spread;
  bool whole;  // whole numbers: many equal distances, and points that coincide
};

std::vector<float> PointsOf(const Input& input, uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  std::vector<double> centres(input.num_groups * input.num_channels);
  for (double& value : centres) value = 10 * normal(random);
  std::vector<float> points(static_cast<size_t>(input.count) * kFeatureSize);
  for (int point = 0; point < input.count; ++point) {
    const size_t group = random() % input.num_groups;
    for (int k = 0; k < input.num_channels; ++k) {
      const double value = centres[group * input.num_channels + k] + input.spread * normal(random);
      points[point * kFeatureSize + k] =
          static_cast<float>(input.whole ? std::round(value) : value);
    }
  }
  return points;
}

void ExpectNaive(const Input& input) {
  const std::unique_ptr<Backend> backend = MakeCpuBackend(1);
  int num_clusters = 0;
  for (uint64_t seed = 0; seed < 40; ++seed) {
    const std::vector<float> points = PointsOf(input, seed);
    for (const auto& [min_cluster_size, min_samples] :
         {std::pair(2, 1), std::pair(2, 3), std::pair(4, 4), std::pair(7, 2), std::pair(5, 8)}) {
      SCOPED_TRACE(::testing::Message() << "seed " << seed << ", min_cluster_size "
                                        << min_cluster_size << ", min_samples " << min_samples);
      const Clusters want = NaiveHdbscan(points, min_cluster_size, min_samples);
      const auto got = Hdbscan(*backend, points, {min_cluster_size, min_samples});
      ASSERT_OK(got);
      ASSERT_EQ(got->count, want.count);
      ASSERT_EQ(got->labels, want.labels);
      for (size_t i = 0; i < want.strengths.size(); ++i) {
        ASSERT_NEAR(got->strengths[i], want.strengths[i], 1e-5) << i;
      }
      num_clusters += got->count;
    }
  }
  EXPECT_GT(num_clusters, 100);
}

TEST(HdbscanRandom, IsTheDefinitionOnGroups) {
  ExpectNaive({.count = 36, .num_channels = 3, .num_groups = 4, .spread = 1, .whole = false});
  ExpectNaive({.count = 40, .num_channels = 32, .num_groups = 3, .spread = 4, .whole = false});
}

TEST(HdbscanRandom, IsTheDefinitionOnOneCloud) {
  ExpectNaive({.count = 40, .num_channels = 2, .num_groups = 1, .spread = 1, .whole = false});
}

TEST(HdbscanRandom, IsTheDefinitionOnEqualDistances) {
  ExpectNaive({.count = 40, .num_channels = 2, .num_groups = 3, .spread = 3, .whole = true});
  ExpectNaive({.count = 50, .num_channels = 1, .num_groups = 2, .spread = 15, .whole = true});
  ExpectNaive({.count = 30, .num_channels = 4, .num_groups = 5, .spread = 1, .whole = true});
}

TEST(HdbscanRandom, IsTheDefinitionOnFewPoints) {
  for (int count = 8; count < 16; ++count) {
    ExpectNaive({.count = count, .num_channels = 2, .num_groups = 2, .spread = 3, .whole = true});
  }
}

}  // namespace
}  // namespace pepeseg
