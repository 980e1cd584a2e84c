#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "core/train/settings/training_settings.h"
#include "tests/bench/option_flags.h"

namespace pepeseg {

// The options of both stages, with the names that they have in the contract.
struct StageOptions {
  ReconstructOptions reconstruct;
  FeatureOptions features;
};
inline void VisitOptions(StageOptions& stages, OptionVisitor visit) {
  VisitPart("reconstruct", stages.reconstruct, visit);
  VisitPart("features", stages.features, visit);
}

// Adds -o NAME=VALUE for all options, short forms of four of them, and --preset NAME, which sets
// both stages before the other flags are applied, at any position.
inline void AddStageFlags(CLI::App& app, StageOptions& stages) {
  app.option_defaults()->multi_option_policy(CLI::MultiOptionPolicy::TakeLast);
  app.add_option("--steps", stages.reconstruct.num_steps);
  app.add_option("--seed", stages.reconstruct.seed);
  app.add_option("--feature-steps", stages.features.num_steps);
  app.add_option("--feature-seed", stages.features.seed);
  app.option_defaults()->multi_option_policy(CLI::MultiOptionPolicy::Throw);
  AddOptionFlags(app, stages);
  app.add_option_function<std::string>(
         "--preset",
         [&stages](const std::string& name) {
           const Preset preset = name == "preview" ? Preset::kPreview
                                 : name == "best"  ? Preset::kBest
                                 : name == "paper" ? Preset::kPaper
                                                   : Preset::kStandard;
           Apply(preset, stages.reconstruct, stages.features);
         },
         "preview, standard, best or paper")
      ->check(CLI::IsMember({"preview", "standard", "best", "paper"}))
      ->trigger_on_parse();
}

}  // namespace pepeseg
