#pragma once

#include <cstdint>
#include <limits>
#include <string>
#include <string_view>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"

namespace pepeseg {

// A part of a stage that this scene does not need, or that its options leave out.
struct SkippedTerm {
  // "depth", "refinement", "bands", "steps"; "background", "centroids", "perception"
  std::string term;
  std::string reason;       // for a person
  int64_t step = 0;         // steps done when it was decided; 0: at the start
  int64_t saved_steps = 0;  // that are not done for it
};

// What a stage tells after a step. NaN: not measured in this step.
struct StepReport {
  std::string_view stage;  // "sfm", "priors", "reconstruct", "features"
  int64_t step = 0;        // from 1
  int64_t num_steps = 0;
  double loss = std::numeric_limits<double>::quiet_NaN();
  double psnr = std::numeric_limits<double>::quiet_NaN();  // of the training view of this step, dB
  int64_t num_gaussians = 0;
  int64_t num_culled_degenerate = 0;  // since the start of the stage
  int64_t num_skipped_gradients = 0;  // likewise
  int64_t num_void_renders = 0;       // likewise: steps done again, see RenderArgs::entry_room
  int64_t num_refined = 0;  // since the start of the stage: Gaussians that refinement shortened
  int64_t num_refine_split = 0;    // likewise: Gaussians that it added
  int64_t num_skipped_depths = 0;  // likewise: steps whose view's depth could not be fitted
  double depth_loss = std::numeric_limits<double>::quiet_NaN();  // weighted; not part of `loss`
  // What the steps are, as in "matching 19 of 60 pairs": literals. Both empty: steps.
  std::string_view activity = {}, unit = {};
  // Share of the stage's work that is done, [0, 1]. NaN: as the steps tell.
  double share = std::numeric_limits<double>::quiet_NaN();
};

// Called after each step: an error returned (CANCELLED, say) ends the stage with that error.
using ProgressFn = absl::FunctionRef<absl::Status(const StepReport&)>;

}  // namespace pepeseg
