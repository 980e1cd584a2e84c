#pragma once

#include "core/reconstruct/reconstruct.h"
#include "kernels/ops.h"

namespace pepeseg {

// What a step is to use; steps count from 0.
class Schedule {
 public:
  Schedule(const ReconstructOptions& options, double scene_radius)
      : options_(options), scene_radius_(scene_radius) {}

  LearningRates RatesAt(int step) const;
  int ShDegreeAt(int step) const;
  float DepthWeightAt(int step) const;  // of the depth loss; 0: leave it out
  int ShrinkAt(int step) const;         // 1, 2 or 4: photographs are 1 / this of their size

 private:
  double ShareAt(int step) const { return static_cast<double>(step) / options_.num_steps; }

  ReconstructOptions options_;
  double scene_radius_;
};

}  // namespace pepeseg
