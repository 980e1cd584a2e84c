#pragma once

#include <limits>
#include <vector>

#include "core/reconstruct/options.h"
#include "core/scene/capture.h"
#include "kernels/ops/render.h"

namespace pepeseg {

// Learning rates, SH degree, depth weight and photograph size by schedule position, from 0
// (METHOD.md section 1). All depend on step / num_steps only.
class Schedule {
 public:
  // pixel_span: see PixelSpan; it bounds the learning rate of the means.
  Schedule(const ReconstructOptions& options, double scene_radius,
           double pixel_span = std::numeric_limits<double>::infinity())
      : options_(options), scene_radius_(scene_radius), pixel_span_(pixel_span) {}

  LearningRates RatesAt(int step) const;
  int ShDegreeAt(int step) const;
  float DepthWeightAt(int step) const;  // weight of the depth loss; 0: no depth loss
  int ShrinkAt(int step) const;         // 1, 2 or 4: divisor of the photographs' width and height

 private:
  double MeanRateAtStart() const;  // scene units
  double ShareAt(int step) const { return static_cast<double>(step) / options_.num_steps; }

  ReconstructOptions options_;
  double scene_radius_, pixel_span_;
};

// Returns the width of a pixel at the depth of the scene, in scene units: the median over the views
// of (median depth of the points in front of the view) / (focal length in pixels). At most 256
// views and 1,024 points are taken, evenly spaced. Infinite where no view has a point in front of
// it. It bounds the learning rate of the means (METHOD.md section 1).
double PixelSpan(const Capture& capture, const std::vector<ScenePoint>& points);

}  // namespace pepeseg
