#pragma once

#include <random>

#include "core/reconstruct/reconstruct.h"
#include "core/reconstruct/training_views.h"
#include "kernels/backend.h"

namespace pepeseg {

// The options with depth_weight filled in: 0 where no training view has a prior, else what was
// asked for or, where that is left open, what suits the kind of capture.
ReconstructOptions WithDepthWeight(ReconstructOptions options, const Capture& capture);

// What a step does about depth. A weight of 0: nothing, and no image of depth is made.
struct DepthPlan {
  float weight = 0;
  PixelBox patch;
};

// Memory of the backend, as large as the view; all empty when the plan's weight is 0.
struct DepthImages {
  bool inverse_depth = false;  // for Render, with these:
  DeviceSpan<float> alpha, depth;
  DeviceSpan<float> alpha_grad, depth_grad;  // for RenderBackward
};

// The depth loss of stage one (METHOD.md section 1): rendered depth against the monocular prior of
// the view. One thread at a time; the backend must outlive it.
class DepthTerm {
 public:
  // From options with their depth_weight filled in.
  DepthTerm(Backend& backend, const ReconstructOptions& options, int64_t max_pixels);

  bool allocated() const { return options_.depth_weight == 0 || !images_.empty(); }
  // From now on no plan has a weight; no step that has one may be under way.
  void LeaveOut();
  bool left_out() const { return left_out_; }
  // weight: of the depth loss at this step, see Schedule.
  DepthPlan PlanFor(const TrainingView& view, float weight, std::mt19937_64& random) const;
  DepthImages ImagesFor(const TrainingView& view, const DepthPlan& plan);
  // After Render: writes the gradients and `sums`, [kNumDepthLossSums].
  void Compare(const TrainingView& view, const DepthPlan& plan, DeviceSpan<double> sums);

 private:
  PixelBox DrawPatch(const PinholeView& view, std::mt19937_64& random) const;

  Backend& backend_;
  const ReconstructOptions options_;
  Buffer<float> images_;  // four of the largest view
  bool left_out_ = false;
};

}  // namespace pepeseg
