#pragma once

#include <cstdint>
#include <vector>

#include "core/base/convergence.h"
#include "core/reconstruct/depth_agreement.h"
#include "core/reconstruct/reconstruct.h"

namespace pepeseg {

// What a scene turns out not to need while stage one trains on it. Steps are looked back on in
// windows of whole rounds of the views, and nothing is decided within one, so that a run that was
// broken off and goes on decides the same.
class SceneNeeds {
 public:
  SceneNeeds(const ReconstructOptions& options, int num_views);

  // Of each step, in order. depth_explained: see DepthAgreement.
  void Learn(double loss);
  void LearnDepth(double depth_explained) { depth_.Add(depth_explained); }

  // Whether `step`, from 0, is the last of a window: then, with all of it learnt, Decide.
  bool EndsWindow(int step) const { return (step + 1) % window_ == 0; }
  struct Decision {
    bool leave_out_depth = false;
    bool measure_bands = false;  // see EarnedShDegree; once
    bool close = false;          // only the closing_share of the schedule is left to be done
  };
  Decision Decide(int step);

  // Where it stands, for checkpoints: kNumState numbers.
  static constexpr size_t kNumState = 6;
  std::vector<double> Save() const;
  void Restore(const std::vector<double>& state);

 private:
  bool Grown(int step) const;

  ReconstructOptions options_;
  int window_;
  Convergence loss_;
  DepthAgreement depth_;
};

}  // namespace pepeseg
