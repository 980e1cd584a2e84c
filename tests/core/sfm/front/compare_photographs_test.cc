#include "core/sfm/front/compare_photographs.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>
#include <random>

#include "core/sfm/front/pair_selection.h"
#include "tests/testing/status_testing.h"

// Photographs of points with descriptors of their own, taken by cameras on a circle that look
// outwards, so that only neighbours see the same points.

namespace pepeseg {
namespace {

constexpr int kWidth = 640, kHeight = 480, kPoints = 3000;
constexpr double kFocal = 600;

struct Place {
  std::vector<Eigen::Vector3d> points;
  std::vector<std::vector<uint8_t>> descriptors;
};

Place RandomPlace(uint32_t seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  Place place;
  for (int i = 0; i < kPoints; ++i) {
    const double angle = 2 * M_PI * i / kPoints, radius = 4 + 4 * std::abs(normal(random));
    place.points.emplace_back(radius * std::cos(angle), normal(random), radius * std::sin(angle));
    std::vector<uint8_t>& descriptor = place.descriptors.emplace_back();
    for (int k = 0; k < SfmFeatures::kDescriptorSize; ++k) {
      descriptor.push_back(static_cast<uint8_t>(random() % 8 == 0 ? random() % 180 : random() % 8));
    }
  }
  return place;
}

struct Photographs {
  DatabaseFeatures features;
  std::vector<std::vector<int>> points;  // of each feature of each photograph

  // Adds a photograph from the circle of radius 1, at an angle.
  void Add(const Place& place, double angle) {
    if (features.cameras.empty()) {
      features.cameras = {{1, 2, kWidth, kHeight, {768, 320, 240, 0}, false}};
    }
    const auto id = static_cast<int64_t>(features.images.size()) + 1;
    DatabaseImage& image = features.images.emplace_back();
    image.id = id;
    std::vector<int>& seen = points.emplace_back();
    std::mt19937 random(static_cast<uint32_t>(id));
    const Eigen::Vector3d z(std::cos(angle), 0, std::sin(angle)), y(0, 1, 0), x = y.cross(z);
    for (int i = 0; i < kPoints; ++i) {
      const Eigen::Vector3d ray = place.points[i] - z;
      const double u = kFocal * ray.dot(x) / ray.dot(z) + kWidth / 2;
      const double v = kFocal * ray.dot(y) / ray.dot(z) + kHeight / 2;
      if (ray.dot(z) < 1 || u < 0 || v < 0 || u >= kWidth || v >= kHeight) continue;
      const float scale = 1 + static_cast<float>(i % 97) / 10;
      image.features.keypoints.push_back({static_cast<float>(u), static_cast<float>(v), scale, 0});
      for (const uint8_t value : place.descriptors[i]) {
        image.features.descriptors.push_back(static_cast<uint8_t>(value + random() % 4));
      }
      seen.push_back(i);
    }
  }
};

Photographs Ring(int count, uint32_t seed = 1) {
  Photographs photographs;
  const Place place = RandomPlace(seed);
  for (int i = 0; i < count; ++i) photographs.Add(place, 2 * M_PI * i / count);
  return photographs;
}

absl::StatusOr<std::vector<ComparedPair>> Compare(const Photographs& photographs,
                                                  const ComparisonOptions& options,
                                                  int num_threads = 2) {
  const auto backend = MakeCpuBackend(num_threads);
  ComparisonProgress last;
  return ComparePhotographs(*backend, photographs.features, options,
                            [&](const ComparisonProgress& progress) {
                              EXPECT_LE(progress.done, progress.total);
                              if (last.choosing == progress.choosing) {
                                EXPECT_GE(progress.done, last.done);
                              }
                              last = progress;
                              return absl::OkStatus();
                            });
}

std::vector<PhotographPair> Verified(const std::vector<ComparedPair>& compared) {
  std::vector<PhotographPair> pairs;
  for (const ComparedPair& pair : compared) {
    if (!pair.geometry.inliers.empty()) pairs.push_back({pair.first, pair.second});
  }
  return pairs;
}

TEST(ComparePhotographs, MatchesFeaturesOfTheSamePoints) {
  const Photographs ring = Ring(12);
  ASSERT_OK_AND_ASSIGN(const auto compared, Compare(ring, {}));
  EXPECT_EQ(compared.size(), 66u);
  size_t num_right = 0, num_wrong = 0;
  for (const ComparedPair& pair : compared) {
    for (const FeatureMatch& match : pair.geometry.inliers) {
      const bool same =
          ring.points[pair.first][match.first] == ring.points[pair.second][match.second];
      ++(same ? num_right : num_wrong);
    }
  }
  EXPECT_GT(num_right, 400u);
  EXPECT_EQ(num_wrong, 0u);
  // The angle of view is 56 degrees, so that photographs 30 degrees apart overlap, and those 90
  // degrees apart do not.
  for (const PhotographPair& pair : Verified(compared)) {
    const size_t distance = pair.second - pair.first;
    EXPECT_LE(std::min(distance, 12 - distance), 2u);
  }
}

TEST(ComparePhotographs, DoesNotDependOnTheNumberOfThreads) {
  const Photographs ring = Ring(10);
  ComparisonOptions options;
  options.max_all = 3;
  options.num_threads = 1;
  ASSERT_OK_AND_ASSIGN(const auto one, Compare(ring, options, 1));
  options.num_threads = 3;
  ASSERT_OK_AND_ASSIGN(const auto three, Compare(ring, options, 3));
  ASSERT_EQ(one.size(), three.size());
  for (size_t i = 0; i < one.size(); ++i) {
    EXPECT_EQ(one[i].first, three[i].first);
    EXPECT_EQ(one[i].second, three[i].second);
    EXPECT_EQ(one[i].matches, three[i].matches);
    EXPECT_EQ(one[i].geometry.inliers, three[i].geometry.inliers);
    EXPECT_EQ(one[i].geometry.fundamental, three[i].geometry.fundamental);
  }
}

TEST(ComparePhotographs, SelectsPairsThatConnectARing) {
  const Photographs ring = Ring(40);
  ComparisonOptions options;
  options.max_all = 10;
  ASSERT_OK_AND_ASSIGN(const auto compared, Compare(ring, options));
  EXPECT_LT(compared.size(), 400u);  // of 780
  const PhotographGroups groups = GroupsOf(40, Verified(compared));
  EXPECT_EQ(groups.num_groups, 1u);
  EXPECT_TRUE(groups.bridges.empty());
}

TEST(ComparePhotographs, FindsTheLoopOfASequence) {
  const Photographs ring = Ring(40);
  ComparisonOptions options;
  options.choice = PairChoice::kInSequence;
  options.overlap = 2;
  ASSERT_OK_AND_ASSIGN(const auto compared, Compare(ring, options));
  const std::vector<PhotographPair> verified = Verified(compared);
  EXPECT_TRUE(std::find(verified.begin(), verified.end(), PhotographPair{0, 39}) != verified.end());
}

TEST(ComparePhotographs, LooksForLoopsAmongAFewOfALongSequence) {
  const Photographs ring = Ring(60);
  ComparisonOptions options;
  options.choice = PairChoice::kInSequence;
  options.overlap = 3;
  options.max_for_loops = 20;  // each third photograph
  const auto backend = MakeCpuBackend(2);
  int64_t num_scored = 0;
  const auto progress = [&](const ComparisonProgress& of) {
    if (of.choosing) num_scored = of.total;
    return absl::OkStatus();
  };
  ASSERT_OK_AND_ASSIGN(const auto compared,
                       ComparePhotographs(*backend, ring.features, options, progress));
  EXPECT_EQ(num_scored, 190 - 19);
  EXPECT_EQ(ExpectedPairs(60, options).scored, num_scored);
  EXPECT_LT(compared.size(), 600u);  // of 1,770
  int num_loops = 0;
  for (const PhotographPair& pair : Verified(compared)) {
    if (pair.second - pair.first <= 50) continue;
    ++num_loops;
    EXPECT_EQ(pair.first % 3 + pair.second % 3, 0u);
  }
  EXPECT_GT(num_loops, 1);
}

TEST(ComparePhotographs, LeavesTwoPlacesApart) {
  Photographs both = Ring(12, 1);
  const Photographs other = Ring(12, 2);
  for (DatabaseImage image : other.features.images) {
    image.id += 12;
    both.features.images.push_back(image);
  }
  ComparisonOptions options;
  options.max_all = 10;
  ASSERT_OK_AND_ASSIGN(const auto compared, Compare(both, options));
  EXPECT_EQ(GroupsOf(24, Verified(compared)).num_groups, 2u);
}

TEST(ComparePhotographs, ComparesPhotographsWithoutFeatures) {
  Photographs ring = Ring(3);
  ring.features.images[1].features = {};
  ASSERT_OK_AND_ASSIGN(const auto compared, Compare(ring, {}));
  ASSERT_EQ(compared.size(), 3u);
  EXPECT_TRUE(compared[0].matches.empty());
  EXPECT_TRUE(compared[0].geometry.inliers.empty());
}

TEST(ComparePhotographs, EndsWithTheErrorOfProgress) {
  const Photographs ring = Ring(12);
  const auto backend = MakeCpuBackend(2);
  for (const size_t max_all : {3, 100}) {
    ComparisonOptions options;
    options.max_all = max_all;
    EXPECT_STATUS(ComparePhotographs(*backend, ring.features, options,
                                     [](const ComparisonProgress& progress) {
                                       return progress.done > 0 ? absl::CancelledError("enough")
                                                                : absl::OkStatus();
                                     }),
                  absl::StatusCode::kCancelled, "enough");
  }
}

TEST(ExpectedPairs, AreAllOfFewPhotographs) {
  ComparisonOptions options;
  EXPECT_EQ(ExpectedPairs(80, options).compared, 3160);
  EXPECT_EQ(ExpectedPairs(80, options).scored, 0);
  EXPECT_EQ(ExpectedPairs(200, options).scored, 19900);
  EXPECT_LT(ExpectedPairs(200, options).compared, 3000);
  options.choice = PairChoice::kInSequence;
  EXPECT_EQ(ExpectedPairs(5, options).scored, 0);
  EXPECT_EQ(ExpectedPairs(5, options).compared, 10);
  EXPECT_EQ(ExpectedPairs(200, options).scored, 200 * 199 / 2 - (200 * 10 - 55));
  EXPECT_LT(ExpectedPairs(2000, options).scored, 45000);
}

}  // namespace
}  // namespace pepeseg
