#pragma once

#include <cstdint>
#include <vector>

#include "core/sfm/two_view/relative_pose.h"
#include "core/sfm/two_view/two_view_geometry.h"

namespace pepeseg {

// How two cameras see one set of points.
struct SceneShape {
  int num_points = 300;
  double outlier_share = 0;  // of the matches: the second position is drawn anywhere
  double noise = 0.5;        // standard deviation of both positions, pixels
  bool planar = false;       // all points on one plane
  bool turn_only = false;    // the second camera does not move
  uint64_t seed = 1;
};

// Photographs of 1000 x 750 pixels with a focal length of 900.
struct TwoViewScene {
  std::vector<Keypoint> first, second;
  std::vector<FeatureMatch> matches;  // i to i
  std::vector<bool> is_true;          // of each match
  RelativePose pose;                  // with a zero translation where turn_only
  TwoViewCameras cameras;

  TwoViewCameras WithoutFocals() const;
};
TwoViewScene MakeTwoViewScene(const SceneShape& shape);

}  // namespace pepeseg
