#pragma once

#include <limits>

#include "core/reconstruct/reconstruct.h"
#include "kernels/ops/render.h"

namespace pepeseg {

// Learning rates, SH degree, depth weight and photograph size by schedule position, from 0
// (METHOD.md section 1.1). All depend on step / num_steps only.
class Schedule {
 public:
  // pixel_span: see PixelSpan; it caps the learning rate of the means.
  Schedule(const ReconstructOptions& options, double scene_radius,
           double pixel_span = std::numeric_limits<double>::infinity())
      : options_(options), scene_radius_(scene_radius), pixel_span_(pixel_span) {}

  LearningRates RatesAt(int step) const;
  int ShDegreeAt(int step) const;
  float DepthWeightAt(int step) const;  // weight of the depth loss; 0: no depth loss
  int ShrinkAt(int step) const;         // 1, 2 or 4: divisor of the photographs' width and height

 private:
  double ShareAt(int step) const { return static_cast<double>(step) / options_.num_steps; }

  ReconstructOptions options_;
  double scene_radius_, pixel_span_;
};

}  // namespace pepeseg
