#pragma once

#include <filesystem>
#include <set>
#include <string>

#include "core/sfm/front/compare_photographs.h"

namespace pepeseg::testing {

// Five photographs "c1/000001.jpg", ... from places in a row, with the matches of all pairs: 200
// points in front of them, seen through a SIMPLE_RADIAL lens.
inline constexpr int kNumPhotographs = 5, kNumPoints = 200;
ComparedDatabase CompareScene();

// Writes a model of the scene: the true poses, but for photographs in `misplaced` (from 0).
void WriteSceneModel(const std::filesystem::path& folder, const std::set<int>& misplaced);

}  // namespace pepeseg::testing
