#pragma once

#include <map>

#include "absl/status/status.h"
#include "absl/strings/string_view.h"
#include "core/base/options.h"
#include "core/dataset/import.h"
#include "core/features/options.h"
#include "core/priors/priors.h"
#include "core/reconstruct/options.h"
#include "core/sfm/sfm_options.h"

namespace pepeseg {

// Trade-off between training time and quality (tests/bench/results/curves/curves.md).
enum class Preset {
  kPreview = 1,   // the shortest training that gives something to click on
  kStandard = 2,  // the defaults, where more time begins to gain less quality
  kBest = 3,      // where more time gains no quality
  kPaper = 4,     // the recipe of the paper as printed, see SetPaper
};
// Returns INVALID_ARGUMENT for a number that is not a preset.
absl::Status Validate(Preset preset);

// Sets the options to the recipe of PePESeg3D as printed (METHOD.md section 9), without anything
// that METHOD.md section 7 adds. Seeds and the number of samples drawn ahead keep their values.
void SetPaper(ReconstructOptions& reconstruct, FeatureOptions& features);

// Sets the options that differ between the presets; the others keep their values.
void Apply(Preset preset, ReconstructOptions& reconstruct, FeatureOptions& features);

// The options of every stage of a training.
struct TrainingSettings {
  Preset preset = Preset::kStandard;  // preset that the options of the stages were derived from
  ImportOptions import;
  PriorOptions priors;
  SfmOptions sfm;
  ReconstructOptions reconstruct;
  FeatureOptions features;
};

// Passes the options of every stage to `visit`, with names such as "reconstruct.num_steps". The
// preset is not one of them: it sets others.
void VisitOptions(TrainingSettings& settings, OptionVisitor visit);

// Returns INVALID_ARGUMENT, naming the option and its range, unless all options are in range.
absl::Status Validate(const TrainingSettings& settings);

// Returns what each option does, by name: the comment on its member, which describe_options.py
// reads from the header when the program is built.
const std::map<absl::string_view, absl::string_view>& OptionDescriptions();

}  // namespace pepeseg
