#pragma once

#include <vector>

#include "core/features/batch_drawer.h"
#include "core/features/near_views.h"
#include "core/scene/gaussians.h"
#include "kernels/backend.h"
#include "tests/testing/synthetic_capture.h"

namespace pepeseg::testing {

// The synthetic scene with depth priors, measured as stage two does before its first step.
struct PerceptionScene {
  explicit PerceptionScene(SyntheticOptions options = {.num_views = 8,
                                                       .num_points = 4000,
                                                       .depth = DepthPrior::Kind::kDisparity});

  SyntheticScene scene;
  Gaussians gaussians;
  Reprojection reprojection;                    // of the training views
  std::vector<std::vector<float>> mask_scales;  // by view
  std::vector<DrawableView> views;

 private:
  std::vector<int> TrainedViews() const;
};

// Removes the first mask of every other view.
void DropMasks(Capture& capture);

}  // namespace pepeseg::testing
