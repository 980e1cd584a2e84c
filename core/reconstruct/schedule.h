#pragma once

#include <limits>

#include "core/reconstruct/reconstruct.h"
#include "kernels/ops/render.h"

namespace pepeseg {

// What a step is to use; steps count from 0.
class Schedule {
 public:
  // pixel_span: see PixelSpan; means are moved by no more than a share of it in a step.
  Schedule(const ReconstructOptions& options, double scene_radius,
           double pixel_span = std::numeric_limits<double>::infinity())
      : options_(options), scene_radius_(scene_radius), pixel_span_(pixel_span) {}

  LearningRates RatesAt(int step) const;
  int ShDegreeAt(int step) const;
  float DepthWeightAt(int step) const;  // of the depth loss; 0: leave it out
  int ShrinkAt(int step) const;         // 1, 2 or 4: photographs are 1 / this of their size

 private:
  double ShareAt(int step) const { return static_cast<double>(step) / options_.num_steps; }

  ReconstructOptions options_;
  double scene_radius_, pixel_span_;
};

}  // namespace pepeseg
