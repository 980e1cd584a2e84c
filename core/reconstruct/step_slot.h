#pragma once

#include <cstdint>

#include "core/reconstruct/depth_term.h"
#include "core/reconstruct/reconstruct.h"
#include "core/reconstruct/step_results.h"
#include "kernels/backend.h"

namespace pepeseg {

// Memory of one step from its render to its update. Steps of which each has a slot of its own can
// be done at once.
struct StepSlot {
  // max_pixels: of the largest view.
  StepSlot(Backend& backend, int64_t max_pixels)
      : color(backend, 3 * max_pixels),
        color_grad(backend, 3 * max_pixels),
        loss_sums(backend, kNumLossSums) {}

  // False: the backend is out of memory.
  bool allocated() const { return !color.empty() && !color_grad.empty() && !loss_sums.empty(); }

  RenderScratch scratch;
  Buffer<float> color, color_grad;  // [3, H, W] of the largest view
  Buffer<double> loss_sums;         // [kNumLossSums]
};

// Returns the number of steps that stage one does at once, 1 to kMaxUpdateSteps: views_at_once of
// the options or, where that is 0, as many as the backend has branches for and photographs of
// `max_pixels` need to fill a device. 1 with a depth loss, whose images all steps share.
int StepsAtOnce(const Backend& backend, const ReconstructOptions& options, int64_t max_pixels);

}  // namespace pepeseg
