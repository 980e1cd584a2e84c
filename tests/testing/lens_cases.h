#pragma once

#include <algorithm>
#include <vector>

#include "core/scene/lens.h"

namespace pepeseg::testing {

// A lens of 160x120 pixels that distorts; DistortingLenses() has one of each model.
struct LensCase {
  LensModel model;
  std::vector<double> distortion;

  Lens MakeLens() const {
    Lens lens{.model = model, .width = 160, .height = 120};
    lens.fx = 120, lens.fy = 122, lens.cx = 83, lens.cy = 57;
    std::copy(distortion.begin(), distortion.end(), lens.distortion.begin());
    return lens;
  }
};

inline const std::vector<LensCase>& DistortingLenses() {
  static const std::vector<LensCase> cases = {
      {LensModel::kSimpleRadial, {-0.15}},
      {LensModel::kRadial, {0.2, -0.03}},
      {LensModel::kOpencv, {-0.2, 0.05, 0.002, -0.003}},
      {LensModel::kOpencvFisheye, {0.03, -0.01, 0.002, 0}},
      {LensModel::kFullOpencv, {-0.2, 0.05, 0.002, -0.003, 0.01, 0.02, 0.01, 0}},
      {LensModel::kFov, {0.8}},
      {LensModel::kSimpleRadialFisheye, {0.02}},
      {LensModel::kRadialFisheye, {0.02, -0.01}},
      {LensModel::kThinPrismFisheye, {0.03, -0.01, 0.001, 0.002, 0, 0, 0.003, -0.002}},
  };
  return cases;
}

}  // namespace pepeseg::testing
