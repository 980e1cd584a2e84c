#pragma once

#include "core/dataset/import.h"
#include "core/features/train_features.h"
#include "core/priors/prior_options.h"
#include "core/reconstruct/reconstruct.h"
#include "core/sfm/sfm_options.h"
#include "core/train/preset.h"

namespace pepeseg {

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
