#pragma once

#include <random>

#include "core/reconstruct/options.h"
#include "core/reconstruct/training_views.h"
#include "core/scene/capture.h"
#include "kernels/backend.h"

namespace pepeseg {

// Returns the kind of a capture by the poses of its training views: forward-facing when their
// viewing directions spread by less than kForwardFacingSpread. Never kAutomatic.
CaptureKind FindCaptureKind(const Capture& capture);

// Returns the root mean square of the angles between the training views' directions and their mean
// direction, in degrees; 180 where the directions cancel out, 0 without training views.
double ViewingSpread(const Capture& capture);

// Spread that parts forward-facing captures from orbits, degrees. A quarter of a circle about an
// object spreads by 26; captures that walk past a scene, such as LLFF's, by 5 to 15.
inline constexpr double kForwardFacingSpread = 22;

// Returns the options with depth_weight filled in: 0 where no training view has a prior that says
// more than the points do, else the weight of the options or, where that is -1, the default for
// the kind of capture. capture_kind is filled in as well.
ReconstructOptions WithDepthWeight(ReconstructOptions options, const Capture& capture);

// Depth loss of one step.
struct DepthPlan {
  float weight = 0;  // of the loss. 0: no depth loss, and no depth is rendered
  PixelBox patch;    // region of the local fit, for DepthLocalForm::kPatch
};

// Images in backend memory, [H, W] of the view; all empty when the plan's weight is 0.
struct DepthImages {
  bool inverse_depth = false;  // for Render, with these:
  DeviceSpan<float> alpha, depth;
  DeviceSpan<float> alpha_grad, depth_grad;  // for RenderBackward
};

// The depth loss of stage one (METHOD.md section 1, "Depth"): compares the rendered depth with the
// view's monocular prior. To be used by one thread at a time. The backend must outlive it.
class DepthTerm {
 public:
  // options: with depth_weight filled in, see WithDepthWeight. max_pixels: of the largest view.
  DepthTerm(Backend& backend, const ReconstructOptions& options, int64_t max_pixels);

  // False: the backend is out of memory.
  bool allocated() const { return options_.depth_weight == 0 || !images_.empty(); }
  // Drops the term for the rest of the stage and frees its memory. No step with a depth loss may be
  // queued.
  void LeaveOut();
  bool left_out() const { return left_out_; }
  // Returns whether views with a prior have a depth loss at this weight, see
  // Schedule::DepthWeightAt.
  bool InEffect(float weight) const { return weight > 0 && !left_out_; }
  // Returns the depth loss of a step on `view`. weight: see Schedule::DepthWeightAt.
  DepthPlan PlanFor(const TrainingView& view, float weight, std::mt19937_64& random) const;
  DepthImages ImagesFor(const TrainingView& view, const DepthPlan& plan);
  // Queues the loss after Render: writes the gradient images and `sums`, [kNumDepthLossSums].
  void Compare(const TrainingView& view, const DepthPlan& plan, DeviceSpan<double> sums);

 private:
  PixelBox DrawPatch(const PinholeView& view, std::mt19937_64& random) const;

  Backend& backend_;
  const ReconstructOptions options_;
  Buffer<float> images_;  // four images of the largest view, see DepthImages
  Buffer<float> ones_;    // an image of ones, without depth_over_alpha; else empty
  bool left_out_ = false;
};

}  // namespace pepeseg
