#pragma once

#include <filesystem>
#include <vector>

#include "absl/status/statusor.h"
#include "core/scene/model.h"
#include "core/train/settings/training_settings.h"
#include "core/train/training_inputs.h"
#include "core/train/training_observer.h"
#include "kernels/backend.h"

namespace pepeseg {

// A model as it was written, and its origins.
struct TrainedModel {
  Model model;
  Sources sources;
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
// Reuses the results that earlier runs of the same training left in `inputs.folders`; the model is
// the same as without them. Blocks until the model is written. `observer` gets the progress and can
// cancel.
//
// Returns INVALID_ARGUMENT, with the file's name, for a wrong file of the dataset or wrong LPIPS
// weights; DATA_LOSS when stored bytes of a file are damaged; FAILED_PRECONDITION, with the remedy,
// when the photographs give no poses or a program is missing; INTERNAL when the device failed; and
// CANCELLED when the observer cancelled. Throws std::bad_alloc, as the standard library does.
absl::StatusOr<TrainedModel> Train(const TrainingInputs& inputs, const TrainingSettings& settings,
                                   Backend& backend, TrainingObserver& observer);

// Returns true if the training may start a program: COLMAP, or the priors command. Reads headers of
// the files.
bool MayRunPrograms(const TrainingInputs& inputs, const TrainingSettings& settings);
// Returns the files and folders that a training reads besides those of its dataset and of programs:
// networks and their libraries.
std::vector<std::filesystem::path> FilesOf(const TrainingTools& tools);

}  // namespace pepeseg
