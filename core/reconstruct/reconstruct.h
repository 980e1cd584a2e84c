#pragma once

#include <cstdint>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/base/progress.h"
#include "core/reconstruct/capture_kind.h"
#include "core/scene/capture.h"
#include "core/scene/gaussians.h"
#include "kernels/backend.h"

namespace pepeseg {

// What refinement does to a Gaussian that crosses the border of a mask (METHOD.md section 1).
enum class RefineKeep {
  kNone = 1,          // nothing
  kShrink = 2,        // it becomes its part inside the mask
  kSplit = 3,         // likewise, and the part outside becomes a Gaussian too
  kSplitAllAxes = 4,  // likewise, all axes of both shrunk by 0.8 of the part's share
};

// Stage one. Defaults follow 3DGS (Kerbl et al. 2023); schedules are in shares of num_steps so that
// a short run is a short version of the reference one.
struct ReconstructOptions {
  int num_steps = 10000;
  int sh_degree = 3;                         // 0..3, rises by one every num_steps / 30
  float ssim_weight = 0.2f;                  // of 1 - SSIM; L1 gets the rest
  float mean_learning_rate = 1.6e-4f;        // times the scene radius, at the start
  float mean_learning_rate_final = 1.6e-6f;  // likewise, at the end; log-linear between
  float log_scale_learning_rate = 5e-3f;
  float rotation_learning_rate = 1e-3f;
  float opacity_learning_rate = 5e-2f;
  float sh_learning_rate = 2.5e-3f;  // degree 0; higher bands get 1/20 of it
  // Coarse to fine: photographs at a quarter of their size for the first half of this share of
  // num_steps, at half of it for the second half. 0: full size throughout.
  double coarse_until = 0;
  // Depth loss, on views with a depth prior (METHOD.md section 1).
  float depth_weight = -1;  // at the start. -1: 0.05 on an orbit, 0.1 where views face forward
  // At the end, at most depth_weight; reversed sigmoid between. The paper keeps 0.01 to 0.02: a
  // prior's own error then stays in the model (tests/bench/results/h200_desk.md).
  float depth_weight_final = 0;
  float depth_local_weight = 0.25f;  // of local fits, times the depth weight
  DepthLocalForm depth_local_form = DepthLocalForm::kWindows;
  float depth_window = 0.025f;  // radius of the local windows, share of the view's width
  CaptureKind capture_kind = CaptureKind::kAutomatic;
  // Adaptive density control.
  double densify_from = 1.0 / 60;  // share of num_steps
  double densify_until = 0.5;      // share of num_steps
  int densify_every = 100;         // steps
  float densify_gradient = 2e-4f;  // mean |d loss / d mean2d|, NDC units
  float densify_size = 0.01f;      // of the scene radius: clone below, split above
  float prune_opacity = 0.005f;
  int opacity_reset_every = 3000;  // steps; not in the budgeted schedule
  int64_t max_gaussians = 1'000'000;
  // The budgeted schedule: density control aims at one Gaussian for so many pixels of the training
  // photographs (within max_gaussians), grows to it linearly in its time, and densifies those with
  // the largest gradients first, down to a quarter of densify_gradient. At each of its rounds
  // opacities are multiplied by opacity_decay, in place of the resets: what the photographs do not
  // pull back fades and is pruned. 0: the reference schedule, all over densify_gradient, and
  // resets.
  double pixels_per_gaussian = 50;
  float opacity_decay = 0.95f;
  // Gaussian refinement, on views with masks. Its window begins at the first step at full size from
  // refine_from on; each view comes twice at most.
  RefineKeep refine_keep = RefineKeep::kShrink;
  double refine_from = 4000.0 / 30000;   // share of num_steps
  double refine_length = 200.0 / 30000;  // share of num_steps
  double refine_candidates = 0.1;        // share of the Gaussians in a view, by depth error
  // What a scene turns out not to need is left out, as SceneNeeds decides; each 0: never.
  //
  // Once Gaussians have stopped growing: when the loss of the training views has fallen by less
  // than this share over a round of at least 500 steps, only the last closing_share of the schedule
  // is still done.
  double min_loss_fall = 0.01;
  double closing_share = 0.1;
  // Spherical harmonics of higher degrees that better the training views by less than so many dB.
  double min_band_gain = 0.1;
  // The depth loss, when a smaller share of the views' priors agrees with the rendered depth.
  double min_depth_agreement = 0.5;
  // What to start from when the capture has no points, drawn inside the cameras' reach.
  int64_t num_random_points = 20'000;
  uint64_t seed = 1;
};
absl::Status Validate(const ReconstructOptions& options);

// FAILED_PRECONDITION when the capture cannot be trained on (no training view, ...).
absl::StatusOr<Gaussians> Reconstruct(Backend& backend, const Capture& capture,
                                      const ReconstructOptions& options, ProgressFn progress);

class Reconstructor;
// The rest of its steps, as Reconstruct does them; `progress` may Save it.
absl::StatusOr<Gaussians> FinishReconstruction(Reconstructor& reconstructor, ProgressFn progress);

}  // namespace pepeseg
