#pragma once

#include "absl/status/status.h"
#include "core/features/train_features.h"
#include "core/reconstruct/reconstruct.h"

namespace pepeseg {

// How long a training may take for what it gives (tests/bench/results/curves/curves.md).
enum class Preset {
  kPreview = 1,   // as soon as there is something to click on
  kStandard = 2,  // the defaults: where the curves bend
  kBest = 3,      // where they are flat
};
absl::Status Validate(Preset preset);

// Sets the options that make the preset out; the others keep what they have.
void Apply(Preset preset, ReconstructOptions& reconstruct, FeatureOptions& features);

}  // namespace pepeseg
