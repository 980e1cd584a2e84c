#pragma once

#include <optional>
#include <string_view>

namespace pepeseg {

// The stages of a training, in the order of ARCHITECTURE.md.
enum class Stage { kPrepare, kSfm, kPriors, kReconstruct, kEvaluate, kFeatures, kIndex };
inline constexpr int kNumStages = 7;

// Returns the stage's name in files, logs and metrics: "prepare", "sfm", ...
const char* NameOf(Stage stage);
// Returns the stage of that name; nullopt: there is none.
std::optional<Stage> StageNamed(std::string_view name);

// The parts of the stages that can be skipped: the first four of stage one, kSteps and the others
// of stage two.
enum class Part {
  kDepth,
  kRefinement,
  kBands,
  kSteps,
  kBackground,
  kCentroids,
  kPerception,
};
inline constexpr int kNumParts = 7;

// Returns the part's name in logs: "depth", "refinement", ...
const char* NameOf(Part part);

}  // namespace pepeseg
