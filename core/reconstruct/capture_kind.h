#pragma once

#include "core/scene/capture.h"

namespace pepeseg {

enum class CaptureKind {
  kAutomatic,      // as FindCaptureKind says
  kOrbit,          // the cameras go around what they look at
  kForwardFacing,  // they look in about one direction: depth is known to a smaller parallax
};

// From the poses of the training views: forward-facing when their viewing directions spread by less
// than kForwardFacingSpread about their mean. Never kAutomatic.
CaptureKind FindCaptureKind(const Capture& capture);

// Root mean square of the angles between the training views' directions and the mean direction, in
// degrees; 180 where they cancel out, 0 without views.
double ViewingSpread(const Capture& capture);

// Degrees. A quarter of a circle about an object spreads by 26; captures that walk past a scene, as
// LLFF's, by 5 to 15.
inline constexpr double kForwardFacingSpread = 22;

}  // namespace pepeseg
