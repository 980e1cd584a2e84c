#pragma once

#include <cstdint>
#include <vector>

#include "core/base/convergence.h"
#include "core/reconstruct/depth_agreement.h"
#include "core/reconstruct/reconstruct.h"

namespace pepeseg {

// Decides which parts of stage one a scene does not need (METHOD.md section 1.6). Decisions are
// made only at the end of a window of steps, of whole rounds of the views, so that a run that
// resumes from a checkpoint decides the same.
class SceneNeeds {
 public:
  SceneNeeds(const ReconstructOptions& options, int num_views);

  // Record the loss of each step, and the depth comparison of each step that has one, in order.
  // depth_explained: see DepthAgreement::Add.
  void Learn(double loss);
  void LearnDepth(double depth_explained) { depth_.Add(depth_explained); }

  // True when `step`, from 0, is the last of its window. Decide is then due, once all steps up to
  // it are recorded.
  bool EndsWindow(int step) const { return (step + 1) % window_ == 0; }
  struct Decision {
    bool leave_out_depth = false;  // the depth priors do not agree with the scene
    bool measure_bands = false;    // EarnedShDegree is due; true once
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

}  // namespace pepeseg
