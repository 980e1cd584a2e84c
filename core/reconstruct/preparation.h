#pragma once

#include <random>
#include <vector>

#include "core/base/progress.h"
#include "core/reconstruct/free_space.h"
#include "core/reconstruct/initial_gaussians.h"
#include "core/reconstruct/options.h"
#include "core/reconstruct/schedule.h"
#include "core/reconstruct/training_views.h"
#include "core/scene/capture.h"
#include "kernels/backend.h"

namespace pepeseg {

// Results of stage one before its first step. They do not change while it trains.
struct PreparedScene {
  // The backend must outlive it, the capture need not. random: the engine of the stage, from which
  // starting points are drawn if the capture has none.
  PreparedScene(Backend& backend, const Capture& capture, const ReconstructOptions& given,
                std::mt19937_64& random);

  const ReconstructOptions options;        // as this capture needs them, see OptionsFor
  const std::vector<SkippedPart> skipped;  // parts that the capture lacks what they need for
  const double radius;                     // scene units, see SceneRadius
  const float near_plane;                  // scene units
  const std::vector<ScenePoint> points;    // the Gaussians start at them
  const LogScaleBounds log_scales;
  const Schedule schedule;
  const FreeSpace free_space;
  const MemoryPlace place;  // of photographs and masks
  const TrainingViews views;
  const std::vector<bool> blurred;  // by training view; empty where blurred ones count like others
};

}  // namespace pepeseg
