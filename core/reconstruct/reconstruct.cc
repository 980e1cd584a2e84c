#include "core/reconstruct/reconstruct.h"

#include <memory>

#include "core/base/status_macros.h"
#include "core/reconstruct/reconstructor.h"

namespace pepeseg {

absl::StatusOr<Gaussians> Reconstruct(Backend& backend, const Capture& capture,
                                      const ReconstructOptions& options, ProgressFn progress) {
  ASSIGN_OR_RETURN(const std::unique_ptr<Reconstructor> reconstructor,
                   Reconstructor::Create(backend, capture, options));
  return FinishReconstruction(*reconstructor, progress);
}

// The whole of stage one; Reconstructor::Step is what a step does.
absl::StatusOr<Gaussians> FinishReconstruction(Reconstructor& reconstructor, ProgressFn progress) {
  while (!reconstructor.done()) {
    ASSIGN_OR_RETURN(const StepReport report, reconstructor.Step());
    RETURN_IF_ERROR(progress(report));
  }
  return reconstructor.Result();
}

}  // namespace pepeseg
