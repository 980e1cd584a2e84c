#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "core/sfm/features/features.h"

namespace pepeseg {

// Relation of two photographs, with the numbers of COLMAP 3.8's column `config`.
enum class TwoViewKind {
  kDegenerate = 1,         // too few inliers, or all of them on a line or at one place
  kCalibrated = 2,         // the essential matrix fits, focal lengths are known
  kUncalibrated = 3,       // the fundamental matrix fits
  kPlanar = 4,             // a plane, focal lengths are known
  kPanoramic = 5,          // a turn on the spot: a rotation, but no translation
  kPlanarOrPanoramic = 6,  // a plane or a turn on the spot, focal lengths are not known
  kWatermark = 7,          // marks at the border that moved along with the photograph
};

// Intrinsics of one photograph. The principal point is the centre.
struct TwoViewCamera {
  int width = 0, height = 0;  // pixels
  double focal = 0;           // pixels; 0: not known
};
struct TwoViewCameras {
  TwoViewCamera first, second;
};

struct TwoViewOptions {
  double max_error = 3;                  // pixels: largest distance of an inlier, see MagsacLoss
  int min_inliers = 15;                  // distinct inliers that a pair needs
  int max_trials = 1000;                 // RANSAC's samples for each matrix
  double confidence = 0.999;             // RANSAC's probability of a sample without outliers
  double max_homography_share = 0.8;     // more inliers of H than this share of F's: planar
  double min_essential_share = 0.95;     // more inliers of E than this share of F's: calibrated
  double max_rotation_deviation = 0.02;  // see IsPureRotation
  uint64_t seed = 0;
};

// Matrices in pixels, x' F x = 0 and x' ~ H x with x of the first photograph, and for the
// normalised coordinates of E as well. Of norm 1 (E: sqrt(2)), zero where not estimated.
struct TwoViewGeometry {
  TwoViewKind kind = TwoViewKind::kDegenerate;
  Eigen::Matrix3d fundamental = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d essential = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d homography = Eigen::Matrix3d::Zero();
  std::vector<FeatureMatch> inliers;  // in the order of the matches; none if degenerate
};

// Verifies matches by F, H and, where both focal lengths are known, E (see LoRansac). Depends on
// the arguments only, so that pairs can be verified on any thread in any order. Ignores matches
// whose index is out of range or whose position is not finite or beyond 1e6; several matches
// of the same two positions count once. Returns kDegenerate with zero matrices rather than an
// error.
TwoViewGeometry EstimateTwoViewGeometry(std::span<const Keypoint> first,
                                        std::span<const Keypoint> second,
                                        std::span<const FeatureMatch> matches,
                                        const TwoViewCameras& cameras,
                                        const TwoViewOptions& options);

// Returns the camera matrix K of a photograph with a known focal length.
Eigen::Matrix3d CameraMatrix(const TwoViewCamera& camera);

// Returns whether K'^-1 H K is a rotation: after scaling to determinant 1, all singular values
// differ from 1 by less than `max_deviation`.
bool IsPureRotation(const Eigen::Matrix3d& homography, const TwoViewCameras& cameras,
                    double max_deviation);

}  // namespace pepeseg
