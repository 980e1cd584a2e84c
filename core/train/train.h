#pragma once

#include <map>
#include <string>

#include "absl/status/statusor.h"
#include "core/scene/model.h"
#include "core/train/training_inputs.h"
#include "core/train/training_observer.h"
#include "core/train/training_settings.h"
#include "kernels/backend.h"

namespace pepeseg {

struct TrainedModel {
  Model model;
  // Where "poses", "masks" and "depth" came from, see TrainingScene::sources.
  std::map<std::string, std::string> sources;
};

// Trains a model from the files of a dataset and writes it to `inputs.folders.run`. The stages, in
// this order:
//   prepare      files to photographs, and to views where poses are given
//   sfm          poses of the photographs, by COLMAP; skipped where they are given
//   priors       masks and depth, where they are not given
//   reconstruct  stage one: Gaussians (METHOD.md section 1); skipped where they are given
//   evaluate     scores of the held-out views
//   features     stage two: a feature per Gaussian (METHOD.md sections 2 and 3); skipped where
//                there are no masks
//   index        the files of the model
// What earlier runs of the training have left in `inputs.folders` is not done again: the result is
// the same. Blocks until the model is written; `observer` hears of the progress and can cancel.
//
// INVALID_ARGUMENT names the file, of the dataset or of the LPIPS weights, that is wrong.
// DATA_LOSS: stored bytes of a file are damaged. FAILED_PRECONDITION: the photographs do not give
// poses, or a program is missing, and what to do. INTERNAL: the device failed. CANCELLED: the
// observer cancelled. Throws std::bad_alloc, as the standard library does.
absl::StatusOr<TrainedModel> Train(const TrainingInputs& inputs, const TrainingSettings& settings,
                                   Backend& backend, TrainingObserver& observer);

}  // namespace pepeseg
