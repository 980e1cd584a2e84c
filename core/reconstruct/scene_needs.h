#pragma once

#include <cstdint>
#include <vector>

#include "core/base/progress.h"
#include "core/reconstruct/gaussian_state.h"
#include "core/reconstruct/options.h"
#include "core/reconstruct/training_views.h"
#include "core/scene/capture.h"

namespace pepeseg {

// Returns the parts of stage one that the options want but the capture lacks what they need, with
// the reason. options: as given to the stage.
std::vector<SkippedPart> SkippedParts(const ReconstructOptions& options, const Capture& capture);

// Decides whether the depth priors fit the scene at all (METHOD.md section 1, "Depth"): a prior
// that is upside down, constant or noise teaches nothing and costs a rendered channel.
class DepthAgreement {
 public:
  // min_share: smallest share of a window's comparisons that must agree, in [0, 1]. 0: never fails.
  explicit DepthAgreement(double min_share) : min_share_(min_share) {}

  // Adds a comparison of a view's prior with its rendered depth; to be called in the order of the
  // steps. explained: share of the prior's spread that the fit explains, <= 1; 0 without a fit.
  void Add(double explained);
  // Ends a window of steps and begins the next one. Returns true when fewer than min_share agreed
  // in this window and in the one before. One such window does not suffice: the scene may not have
  // taken shape yet.
  bool Failed();

  // State for checkpoints.
  struct State {
    int64_t num = 0, num_agreeing = 0;  // comparisons in the present window
    int64_t failed_before = 0;          // 1: fewer than min_share agreed in the window before
  };
  const State& state() const { return state_; }
  void Restore(const State& state) { state_ = state; }

 private:
  double min_share_;
  State state_;
};

// Decides which parts of stage one a scene does not need (METHOD.md section 1, "What a scene does
// not need"). Decisions are made only at the end of a window of steps, of whole rounds of the
// views, so that a run that resumes from a checkpoint decides the same.
class SceneNeeds {
 public:
  SceneNeeds(const ReconstructOptions& options, int num_views);

  // Record the loss of each step, and the depth comparison of each step that has one, in order.
  // depth_explained: see DepthAgreement::Add.
  void RecordLoss(double loss);
  void RecordDepth(double depth_explained) { depth_.Add(depth_explained); }

  // True when `step`, from 0, is the last of its window. Decide is then due, once all steps up to
  // it are recorded.
  bool EndsWindow(int step) const { return (step + 1) % window_ == 0; }
  struct Decision {
    bool leave_out_depth = false;  // the depth priors do not agree with the scene
    bool prune_sh_degree = false;  // SufficientShDegree is due; true once
    bool close = false;            // only the last closing_share of the schedule is to be done
  };
  Decision Decide(int step);

  // State for checkpoints: kNumState numbers.
  static constexpr size_t kNumState = 6;
  std::vector<double> Save() const;
  void Restore(const std::vector<double>& state);

 private:
  bool Grown(int step) const;

  ReconstructOptions options_;
  int window_;  // steps, see Convergence::Window
  Convergence loss_;
  DepthAgreement depth_;
};

// SH degree pruning (METHOD.md section 1, "What a scene does not need"). Returns the smallest
// degree of the spherical harmonics at which the training views (16 of them at most, evenly spaced)
// are rendered to within `min_gain` dB of the PSNR with all degrees. Returns the state's degree
// when the backend is out of memory. Waits for the backend, on which no step may be queued.
int SufficientShDegree(Backend& backend, const TrainingViews& views, float near_plane,
                       GaussianState& state, double min_gain);

}  // namespace pepeseg
