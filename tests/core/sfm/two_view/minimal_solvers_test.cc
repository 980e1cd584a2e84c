#include "core/sfm/two_view/minimal_solvers.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>

#include "core/sfm/two_view/relative_pose.h"
#include "two_view_scene.h"

namespace pepeseg {
namespace {

TwoViewScene ExactScene(uint64_t seed, bool planar = false) {
  return MakeTwoViewScene({.num_points = 20, .noise = 0, .planar = planar, .seed = seed});
}

template <size_t kSize>
std::array<PointPair, kSize> Normalised(const TwoViewScene& scene) {
  const Eigen::Matrix3d inverse = CameraMatrix(scene.cameras.first).inverse();
  std::array<PointPair, kSize> pairs;
  for (size_t i = 0; i < kSize; ++i) {
    const Eigen::Vector3d first(scene.first[i].x, scene.first[i].y, 1);
    const Eigen::Vector3d second(scene.second[i].x, scene.second[i].y, 1);
    pairs[i] = {(inverse * first).hnormalized(), (inverse * second).hnormalized()};
  }
  return pairs;
}

// Returns the smallest distance of a candidate from a matrix, up to scale and sign.
double Distance(const Candidates& candidates, const Eigen::Matrix3d& truth) {
  double smallest = INFINITY;
  for (int i = 0; i < candidates.count; ++i) {
    for (const double sign : {-1.0, 1.0}) {
      smallest = std::min(smallest,
                          (sign * candidates.matrices[i].normalized() - truth.normalized()).norm());
    }
  }
  return smallest;
}

TEST(SolveFundamental, FindsTheMatrixOfSevenPairs) {
  for (uint64_t seed = 1; seed <= 20; ++seed) {
    const TwoViewScene scene = ExactScene(seed);
    const Candidates candidates = SolveFundamental(Normalised<7>(scene));
    EXPECT_LE(candidates.count, 3);
    EXPECT_LT(Distance(candidates, EssentialMatrix(scene.pose)), 2e-3) << seed;
    for (int i = 0; i < candidates.count; ++i) {
      EXPECT_NEAR(candidates.matrices[i].determinant(), 0, 1e-9) << seed;
    }
  }
}

TEST(SolveFundamental, LeavesOutPointsBehindACamera) {
  std::array<PointPair, 7> pairs = Normalised<7>(ExactScene(3));
  const Candidates before = SolveFundamental(pairs);
  ASSERT_GT(before.count, 0);
  for (int i = 0; i < before.count; ++i) {
    const Eigen::Matrix3d& f = before.matrices[i];
    const Eigen::Vector3d left = f.row(0).cross(f.row(1)).norm() > 0
                                     ? Eigen::Vector3d(f.col(0).cross(f.col(1)))
                                     : Eigen::Vector3d(f.col(1).cross(f.col(2)));
    int num_positive = 0;
    for (const PointPair& pair : pairs) {
      num_positive += left.cross(pair.second.homogeneous()).dot(f * pair.first.homogeneous()) > 0;
    }
    EXPECT_TRUE(num_positive == 0 || num_positive == 7) << num_positive;
  }
}

TEST(SolveFundamental, HasNothingForRepeatedPoints) {
  std::array<PointPair, 7> pairs = Normalised<7>(ExactScene(1));
  pairs[6] = pairs[0];
  EXPECT_EQ(SolveFundamental(pairs).count, 0);
}

TEST(SolveHomography, FindsTheMatrixOfFourPairs) {
  for (uint64_t seed = 1; seed <= 20; ++seed) {
    const std::array<PointPair, 20> pairs = Normalised<20>(ExactScene(seed, true));
    std::array<PointPair, 4> sample;
    // Four points of which no three are nearly collinear.
    sample[0] = *std::min_element(pairs.begin(), pairs.end(), [](const auto& a, const auto& b) {
      return a.first.sum() < b.first.sum();
    });
    sample[1] = *std::max_element(pairs.begin(), pairs.end(), [](const auto& a, const auto& b) {
      return a.first.sum() < b.first.sum();
    });
    const auto slope = [](const PointPair& p) { return p.first.x() - p.first.y(); };
    sample[2] = *std::min_element(pairs.begin(), pairs.end(), [&](const auto& a, const auto& b) {
      return slope(a) < slope(b);
    });
    sample[3] = *std::max_element(pairs.begin(), pairs.end(), [&](const auto& a, const auto& b) {
      return slope(a) < slope(b);
    });
    const Candidates candidates = SolveHomography(sample);
    ASSERT_EQ(candidates.count, 1) << seed;
    for (const PointPair& pair : pairs) {
      const Eigen::Vector2d mapped =
          (candidates.matrices[0] * pair.first.homogeneous()).hnormalized();
      EXPECT_LT((mapped - pair.second).norm(), 1e-4) << seed;
    }
  }
}

TEST(SolveHomography, HasNothingForCollinearOrMirroredPoints) {
  std::array<PointPair, 4> pairs;
  pairs[0] = {{0, 0}, {0, 0}}, pairs[1] = {{1, 1}, {1, 1}}, pairs[2] = {{2, 2}, {2, 2}};
  pairs[3] = {{1, 0}, {1, 0}};
  EXPECT_EQ(SolveHomography(pairs).count, 0);
  pairs[0] = {{0, 0}, {0, 0}}, pairs[1] = {{1, 0}, {-1, 0}}, pairs[2] = {{0, 1}, {0, 1}};
  pairs[3] = {{1, 2}, {-1, 2}};
  EXPECT_EQ(SolveHomography(pairs).count, 0);
}

TEST(SolveEssential, FindsTheMatrixOfFivePairs) {
  for (const bool planar : {false, true}) {
    for (uint64_t seed = 1; seed <= 20; ++seed) {
      const TwoViewScene scene = ExactScene(seed, planar);
      const Candidates candidates = SolveEssential(Normalised<5>(scene));
      EXPECT_LT(Distance(candidates, EssentialMatrix(scene.pose)), 5e-3) << planar << seed;
      for (int i = 0; i < candidates.count; ++i) {
        const Eigen::Matrix3d e = candidates.matrices[i], gram = e * e.transpose();
        EXPECT_LT((2 * gram * e - gram.trace() * e).norm(), 1e-6) << planar << seed;
      }
    }
  }
}

}  // namespace
}  // namespace pepeseg
