#pragma once

#include "core/scene/capture.h"

namespace pepeseg {

// Arrangement of the cameras. It decides the default weight of the depth loss (METHOD.md section
// 1.4).
enum class CaptureKind {
  kAutomatic,  // Found from the poses, see FindCaptureKind.
  kOrbit,      // Around what they look at.
  // All in about one direction. The parallax is smaller, so that a depth prior has more to add.
  kForwardFacing,
};

// Returns the kind from the poses of the training views: forward-facing when their viewing
// directions spread by less than kForwardFacingSpread. Never kAutomatic.
CaptureKind FindCaptureKind(const Capture& capture);

// Returns the root mean square of the angles between the training views' directions and their mean
// direction, in degrees; 180 where the directions cancel out, 0 without training views.
double ViewingSpread(const Capture& capture);

// Spread that parts forward-facing captures from orbits, degrees. A quarter of a circle about an
// object spreads by 26; captures that walk past a scene, such as LLFF's, by 5 to 15.
inline constexpr double kForwardFacingSpread = 22;

}  // namespace pepeseg
