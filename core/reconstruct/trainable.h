#pragma once

#include <vector>

#include "absl/status/status.h"
#include "core/base/progress.h"
#include "core/reconstruct/reconstruct.h"
#include "core/scene/capture.h"

namespace pepeseg {

// Returns FAILED_PRECONDITION, with the view's name, when stage one cannot train on the capture:
// no training view, or an image whose size is not its camera's.
absl::Status CheckTrainable(const Capture& capture);

// Returns the parts of stage one that are skipped from the start, with the reason. options: with
// depth_weight filled in, see WithDepthWeight.
std::vector<SkippedTerm> SkippedTerms(const ReconstructOptions& options, const Capture& capture);

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
