#include "core/train/training_settings.h"

#include "absl/strings/str_cat.h"

namespace pepeseg {

absl::Status Validate(Preset preset) {
  if (preset >= Preset::kPreview && preset <= Preset::kBest) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat("preset is ", static_cast<int>(preset),
                   "; it must be 1 (preview), 2 (standard) or 3 (best)"));
}

void Apply(Preset preset, ReconstructOptions& reconstruct, FeatureOptions& features) {
  // kStandard leaves the defaults of the options.
  if (preset == Preset::kPreview) {
    reconstruct.num_steps = 2000;
    reconstruct.coarse_until = 0.5;
    reconstruct.sh_degree = 1;
    features.num_steps = 1500;
  } else if (preset == Preset::kBest) {
    reconstruct.num_steps = 30000;
    features.num_steps = 20000;
  }
}

}  // namespace pepeseg
