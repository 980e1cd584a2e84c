#pragma once

#include <cstdint>
#include <limits>
#include <string>
#include <string_view>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"

namespace pepeseg {

// A part of a stage that is skipped, because this scene does not need it or its options disable it.
struct SkippedTerm {
  // "depth", "refinement", "bands", "steps"; "background", "centroids", "perception"
  std::string term;
  std::string reason;       // for a person
  int64_t step = 0;         // number of steps done when that was decided; 0: at the start
  int64_t saved_steps = 0;  // steps that are not run because of it
};

// Progress of a stage, reported after each step. NaN: not measured in this step. `num_gaussians`
// is the current number; the counts after it run from the start of the stage.
struct StepReport {
  std::string_view stage;  // "sfm", "priors", "reconstruct", "features"
  int64_t step = 0;        // from 1
  int64_t num_steps = 0;
  double loss = std::numeric_limits<double>::quiet_NaN();
  double psnr = std::numeric_limits<double>::quiet_NaN();  // of the training view of this step, dB
  int64_t num_gaussians = 0;
  int64_t num_culled_degenerate = 0;
  int64_t num_skipped_gradients = 0;
  int64_t num_void_renders = 0;    // overflowed renders: steps repeated, see RenderArgs::entry_room
  int64_t num_refined = 0;         // Gaussians that refinement shortened
  int64_t num_refine_split = 0;    // Gaussians that refinement added
  int64_t num_skipped_depths = 0;  // steps in which the view's depth could not be fitted
  double depth_loss = std::numeric_limits<double>::quiet_NaN();  // weighted; not part of `loss`
  // Words for "matching 19 of 60 pairs"; they must be literals. Both empty: a plain count of steps.
  std::string_view activity = {}, unit = {};
  // Share of the stage's work that is done, in [0, 1]. NaN: step / num_steps.
  double share = std::numeric_limits<double>::quiet_NaN();
};

// Called after each step, on the thread of the stage. An error that it returns, such as CANCELLED,
// ends the stage with that error.
using ProgressFn = absl::FunctionRef<absl::Status(const StepReport&)>;

}  // namespace pepeseg
