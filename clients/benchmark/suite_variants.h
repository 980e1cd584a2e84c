#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "clients/benchmark/suite_scene.h"

// Variations of a benchmark's trainings: parts of the method left out, constants changed, and
// poorer inputs.
namespace pepeseg::client::cli {

struct BenchmarkVariant {
  std::string name;                   // "" for the plain training
  std::vector<std::string> settings;  // NAME=VALUE, after those of all trainings
  std::string published;              // what the paper has for it, for people; empty: nothing
  bool quarter_of_views = false;      // train on every fourth view that is not held out
  bool fewer_masks = false;           // leave out 30 % of the masks
};

// Returns the variants of the paper's tables: parts of the reconstruction, parts of the feature
// training, and the sensitivity to k (neighbours), tau (cosine of centroids) and T (steps between
// clusterings). Variants of options that the contract lacks are left out.
std::vector<BenchmarkVariant> AblationVariants();
// Returns the plain training with a quarter of the views, and with 30 % fewer masks.
std::vector<BenchmarkVariant> RobustnessVariants();

// Returns the dataset of a scene as the variant has it. Files of masks that were thinned out are
// written below `folder`. Of views that are not held out, those with index 0, 4, 8 ... by name are
// kept; of the masks of a view, 3 of 10 are left out: those with index 1, 4 and 7 modulo 10.
// INVALID_ARGUMENT: fewer_masks without masks in SAM's format or in folders of PNGs.
absl::StatusOr<DatasetFolder> DatasetOf(const BenchmarkVariant& variant,
                                        const BenchmarkScene& scene,
                                        const std::filesystem::path& folder);

}  // namespace pepeseg::client::cli
