// Compares HDBSCAN with the labels of scikit-learn 1.9.1 (algorithm="brute"; "kd_tree" gave the
// same), up to renaming. A file of tests/data/hdbscan has the number of points, min_cluster_size
// and min_samples, then a line for each point: its label, and 32 coordinates in units of 1/8192.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <map>
#include <string>
#include <vector>

#include "core/cluster/hdbscan.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

// A point of the case "small" between two clusters, which part at its core distance. scikit-learn
// removes equal edges one after the other and leaves the point in one of the clusters, by the order
// of the points; here edges of one length are removed together, and the point is noise.
constexpr size_t kBetween = 80;

struct Recorded {
  std::vector<float> points;  // [n, 32]
  std::vector<int> labels;
  HdbscanOptions options;
};

Recorded ReadRecorded(const std::filesystem::path& path) {
  Recorded recorded;
  std::ifstream file(path);
  int count = 0, label = 0, coordinate = 0;
  file >> count >> recorded.options.min_cluster_size >> recorded.options.min_samples;
  for (int i = 0; i < count; ++i) {
    file >> label;
    recorded.labels.push_back(label);
    for (int k = 0; k < 32; ++k) {
      file >> coordinate;
      recorded.points.push_back(static_cast<float>(coordinate) / 8192);
    }
  }
  EXPECT_TRUE(file) << path;
  return recorded;
}

class RecordedLabelsTest : public ::testing::TestWithParam<std::string> {};
INSTANTIATE_TEST_SUITE_P(ScikitLearn, RecordedLabelsTest,
                         ::testing::Values("blobs", "small", "loose", "nested", "uniform", "one",
                                           "grid"),
                         [](const auto& info) { return info.param; });

TEST_P(RecordedLabelsTest, MatchUpToRenaming) {
  const Recorded recorded =
      ReadRecorded(std::filesystem::path(PEPESEG_TEST_DATA) / "hdbscan" / (GetParam() + ".txt"));
  const auto backend = MakeCpuBackend(2);
  ASSERT_OK_AND_ASSIGN(
      const Clusters clusters,
      Hdbscan(*backend, std::span<const float>(recorded.points), recorded.options));
  ASSERT_EQ(clusters.labels.size(), recorded.labels.size());
  std::map<int, int> ours_of, theirs_of;
  for (size_t i = 0; i < recorded.labels.size(); ++i) {
    if (GetParam() == "small" && i == kBetween) {
      EXPECT_EQ(clusters.labels[i], -1);
      continue;
    }
    const int ours = clusters.labels[i], theirs = recorded.labels[i];
    EXPECT_EQ(ours == -1, theirs == -1) << "point " << i;
    EXPECT_EQ(ours_of.emplace(theirs, ours).first->second, ours) << "point " << i;
    EXPECT_EQ(theirs_of.emplace(ours, theirs).first->second, theirs) << "point " << i;
  }
}

}  // namespace
}  // namespace pepeseg
