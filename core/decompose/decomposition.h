#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/scene/gaussians.h"

namespace pepeseg {

// The segments of a model at several granularity levels, from fine to coarse. A Gaussian is in at
// most one segment of each level, and a segment lies as a whole in one segment of the next level.
struct Decomposition {
  struct Segment {
    int32_t parent = 0;  // id of the segment of the next level that holds it; 0 on the last level
    int64_t num_gaussians = 0;          // at least 1
    std::array<float, 3> min{}, max{};  // bounding box of the Gaussians' means, scene units
  };
  struct Level {
    double scale = 0;               // query scale, [0, 1]
    std::vector<int32_t> ids;       // [num_gaussians] id of the segment, from 1; 0: in no segment
    std::vector<Segment> segments;  // segments[k] has the id k + 1; largest first
  };
  std::vector<Level> levels;  // by scale, ascending
};

// The default scales: parts, objects, groups.
inline constexpr std::array<double, 3> kDefaultDecompositionScales = {0.01, 0.5, 1};
inline constexpr int kMaxLevels = 8;

// Returns INVALID_ARGUMENT unless there are 1 to kMaxLevels scales, all in [0, 1] and ascending
// without repeats.
absl::Status CheckDecompositionScales(std::span<const double> scales);
// Returns INVALID_ARGUMENT unless 0 <= level < levels.size(). The message has the valid range.
absl::Status CheckLevel(const Decomposition& decomposition, int level);
// Returns the Gaussians of a segment. INVALID_ARGUMENT: see CheckLevel, or the level has no segment
// with this id.
absl::StatusOr<GaussianSet> MembersOf(const Decomposition& decomposition, int level, int32_t id);

// Makes a level from the piece of each Gaussian, numbered from 0; -1: in no piece. Segments are
// numbered by the number of their Gaussians, descending; of equal ones the lower piece comes first.
// Parents stay 0.
Decomposition::Level LevelOfPieces(double scale, std::span<const int32_t> pieces,
                                   const Gaussians& gaussians);
// Sets the parents of the segments of `fine`, each of which lies in one segment of `coarse`.
void SetParents(Decomposition::Level& fine, const Decomposition::Level& coarse);

}  // namespace pepeseg
