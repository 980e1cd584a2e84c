#pragma once

#include "absl/status/statusor.h"
#include "core/base/progress.h"
#include "core/reconstruct/options.h"
#include "core/scene/capture.h"
#include "core/scene/gaussians.h"
#include "kernels/backend.h"

namespace pepeseg {

// Stage one: from photographs to Gaussians (METHOD.md section 1). Reconstructor does its steps;
// this header has the loop around it.

// Trains Gaussians on the capture. Calls `progress` after each step; an error that it returns ends
// the stage with that error. Returns INVALID_ARGUMENT for the options, FAILED_PRECONDITION for a
// capture that cannot be trained on (see CheckTrainable), RESOURCE_EXHAUSTED when the backend is
// out of memory, and INTERNAL with the backend's error.
absl::StatusOr<Gaussians> Reconstruct(Backend& backend, const Capture& capture,
                                      const ReconstructOptions& options, ProgressFn progress);

class Reconstructor;
// Does the remaining steps of `reconstructor` as Reconstruct does. `progress` may call its Save().
absl::StatusOr<Gaussians> FinishReconstruction(Reconstructor& reconstructor, ProgressFn progress);

}  // namespace pepeseg
