#pragma once

#include <vector>

#include "absl/status/status.h"
#include "core/base/progress.h"
#include "core/reconstruct/reconstruct.h"
#include "core/scene/capture.h"

namespace pepeseg {

// FAILED_PRECONDITION, with the view named, when stage one cannot train on the capture.
absl::Status CheckTrainable(const Capture& capture);

// What of stage one is left out from the start on. options: with their depth_weight filled in.
std::vector<SkippedTerm> SkippedTerms(const ReconstructOptions& options, const Capture& capture);

}  // namespace pepeseg
