#pragma once

#include "absl/status/status.h"
#include "core/dataset/import.h"
#include "core/features/train_features.h"
#include "core/priors/prior_options.h"
#include "core/reconstruct/reconstruct.h"
#include "core/sfm/sfm_options.h"

namespace pepeseg {

// How long a training takes, for what result (tests/bench/results/curves/curves.md).
enum class Preset {
  kPreview = 1,   // the shortest that gives something to click on
  kStandard = 2,  // the defaults: where the curves of quality over time bend
  kBest = 3,      // where the curves are flat
};
// INVALID_ARGUMENT: a number that is not a preset.
absl::Status Validate(Preset preset);

// Sets the options that differ between the presets; the others keep their values.
void Apply(Preset preset, ReconstructOptions& reconstruct, FeatureOptions& features);

// The options of every stage of a training.
struct TrainingSettings {
  Preset preset = Preset::kStandard;  // from which the options of the stages start
  ImportOptions import;
  PriorOptions priors;
  SfmOptions sfm;
  ReconstructOptions reconstruct;
  FeatureOptions features;
};

}  // namespace pepeseg
