#include "core/base/stage.h"

#include <algorithm>
#include <array>
#include <cstddef>

namespace pepeseg {
namespace {

constexpr std::array<const char*, kNumStages> kStageNames = {
    "prepare", "sfm", "priors", "reconstruct", "evaluate", "features", "index"};
constexpr std::array<const char*, kNumParts> kPartNames = {
    "depth", "refinement", "bands", "steps", "background", "centroids", "perception"};

}  // namespace

const char* NameOf(Stage stage) { return kStageNames[static_cast<size_t>(stage)]; }

std::optional<Stage> StageNamed(std::string_view name) {
  const auto found = std::ranges::find_if(kStageNames, [&](const char* n) { return name == n; });
  if (found == kStageNames.end()) return std::nullopt;
  return static_cast<Stage>(found - kStageNames.begin());
}

const char* NameOf(Part part) { return kPartNames[static_cast<size_t>(part)]; }

}  // namespace pepeseg
