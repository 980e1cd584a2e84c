#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <vector>

#include "core/sfm/two_view/two_view_geometry.h"
#include "two_view_scene.h"

namespace pepeseg {
namespace {

// Draws keypoints by one of several kinds of damage: random bytes, a few repeated positions, whole
// numbers of a small range, or a scene with random bytes in some places.
std::vector<Keypoint> RandomKeypoints(SeededDraws& draws, const std::vector<Keypoint>& scene) {
  std::vector<Keypoint> keypoints = scene;
  const uint32_t kind = draws.Below(4);
  for (Keypoint& keypoint : keypoints) {
    uint64_t bytes[2] = {draws.Next(), draws.Next()};
    if (kind == 0 || (kind == 3 && draws.Below(10) == 0)) std::memcpy(&keypoint, bytes, 16);
    if (kind == 1) keypoint = scene[draws.Below(9)];
    if (kind == 2) keypoint = {float(draws.Below(5)), float(draws.Below(5)), 1, 0};
  }
  return keypoints;
}

TEST(EstimateTwoViewGeometry, SurvivesRandomBytes) {
  const TwoViewScene scene = MakeTwoViewScene({.num_points = 60});
  SeededDraws draws(7);
  for (int round = 0; round < 300; ++round) {
    const std::vector<Keypoint> first = RandomKeypoints(draws, scene.first);
    const std::vector<Keypoint> second = RandomKeypoints(draws, scene.second);
    std::vector<FeatureMatch> matches = scene.matches;
    for (FeatureMatch& match : matches) {
      if (draws.Below(20) == 0) match.second = static_cast<uint32_t>(draws.Next());
      if (draws.Below(5) == 0) match.first = draws.Below(60);
    }
    TwoViewCameras cameras = scene.cameras;
    if (draws.Below(3) == 0) cameras = scene.WithoutFocals();
    if (draws.Below(10) == 0) cameras.first.focal = 1e-300;
    if (draws.Below(10) == 0) cameras.second.focal = 1e300;
    const TwoViewGeometry geometry =
        EstimateTwoViewGeometry(first, second, matches, cameras, {.max_trials = 200});
    EXPECT_TRUE(geometry.fundamental.allFinite()) << round;
    EXPECT_TRUE(geometry.homography.allFinite()) << round;
    EXPECT_TRUE(geometry.essential.allFinite()) << round;
    if (geometry.kind == TwoViewKind::kDegenerate) {
      EXPECT_TRUE(geometry.inliers.empty()) << round;
    } else {
      EXPECT_GE(geometry.inliers.size(), 15u) << round;
    }
    for (const FeatureMatch& match : geometry.inliers) {
      ASSERT_LT(match.first, first.size());
      ASSERT_LT(match.second, second.size());
      EXPECT_TRUE(std::isfinite(first[match.first].x) && std::isfinite(second[match.second].y));
    }
  }
}

}  // namespace
}  // namespace pepeseg
