#include <gtest/gtest.h>

#include <opencv2/calib3d.hpp>
#include <vector>

#include "core/sfm/two_view/two_view_geometry.h"
#include "two_view_scene.h"

namespace pepeseg {
namespace {

// The number of inliers that OpenCV's USAC finds with MAGSAC++.
struct OpenCvPoints {
  std::vector<cv::Point2f> first, second;

  explicit OpenCvPoints(const TwoViewScene& scene) {
    for (const Keypoint& keypoint : scene.first) first.emplace_back(keypoint.x, keypoint.y);
    for (const Keypoint& keypoint : scene.second) second.emplace_back(keypoint.x, keypoint.y);
  }
  int NumFundamentalInliers() const {
    std::vector<uchar> mask;
    cv::findFundamentalMat(first, second, cv::USAC_MAGSAC, 3, 0.999, 1000, mask);
    return cv::countNonZero(mask);
  }
  int NumHomographyInliers() const {
    std::vector<uchar> mask;
    cv::findHomography(first, second, cv::USAC_MAGSAC, 3, mask, 1000, 0.999);
    return cv::countNonZero(mask);
  }
};

TEST(Usac, FindsNoMoreInliersOfAFundamentalMatrix) {
  for (const double outlier_share : {0.1, 0.3, 0.4}) {
    for (uint64_t seed = 1; seed <= 5; ++seed) {
      const TwoViewScene scene = MakeTwoViewScene({.outlier_share = outlier_share, .seed = seed});
      const TwoViewGeometry geometry = EstimateTwoViewGeometry(
          scene.first, scene.second, scene.matches, scene.WithoutFocals(), {});
      EXPECT_GE(static_cast<double>(geometry.inliers.size()),
                0.97 * OpenCvPoints(scene).NumFundamentalInliers())
          << outlier_share << " " << seed;
    }
  }
}

TEST(Usac, FindsNoMoreInliersOfAHomography) {
  for (const double outlier_share : {0.1, 0.5, 0.7}) {
    for (uint64_t seed = 1; seed <= 5; ++seed) {
      const TwoViewScene scene =
          MakeTwoViewScene({.outlier_share = outlier_share, .turn_only = true, .seed = seed});
      const TwoViewGeometry geometry = EstimateTwoViewGeometry(
          scene.first, scene.second, scene.matches, scene.WithoutFocals(), {});
      EXPECT_GE(static_cast<double>(geometry.inliers.size()),
                0.97 * OpenCvPoints(scene).NumHomographyInliers())
          << outlier_share << " " << seed;
    }
  }
}

}  // namespace
}  // namespace pepeseg
