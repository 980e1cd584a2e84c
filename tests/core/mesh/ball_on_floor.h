#pragma once

#include "core/scene/gaussians.h"
#include "core/scene/model.h"

namespace pepeseg {

inline constexpr double kBallRadius = 0.5;

// A red ball around the origin on a grey floor (y is down), of flat Gaussians, seen from a ring of
// views above it. The floor is 2.4 wide and comes after the ball.
struct BallOnFloor {
  Model model;
  GaussianSet ball;
};
BallOnFloor MakeBallOnFloor();

}  // namespace pepeseg
