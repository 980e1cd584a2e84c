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

}  // namespace pepeseg
