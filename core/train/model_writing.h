#pragma once

#include <filesystem>
#include <optional>

#include "absl/status/status.h"
#include "core/scene/capture.h"
#include "core/scene/model.h"
#include "core/train/stage_log.h"
#include "core/train/training_inputs.h"
#include "kernels/backend.h"

namespace pepeseg {

// Returns a model with all that is known before stage one: its views, frame and facts.
Model DescribeModel(const TrainingInputs& inputs, const Capture& capture, const Backend& backend);

// Copies the metrics of the stages so far, and the known sources of their inputs, to the model.
void CopyFindings(const TrainingMetrics& metrics, const Sources& sources, Model& model);

// Returns the Gaussians that an earlier run, which had the same files, options and seed, has left
// in kReconstructFolder.
std::optional<Gaussians> FindEarlierGaussians(const TrainingFolders& folders,
                                              TrainingObserver& observer);

// Writes the model to `folder`, which is created if need be.
absl::Status WriteModelTo(const std::filesystem::path& folder, const Model& model);

// Moves SAM's embeddings of the photographs to the model's folder, before its manifest is there.
// The manifest does not list them: a model is whole without them.
void KeepEmbeddings(const TrainingFolders& folders, const Capture& capture,
                    TrainingObserver& observer);

}  // namespace pepeseg
