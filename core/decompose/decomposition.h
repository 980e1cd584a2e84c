#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/scene/gaussians.h"

namespace pepeseg {

// A model taken apart at ascending scales: each Gaussian is in at most one segment of each level,
// and the segments of one level lie in those of the next as a whole.
struct Decomposition {
  struct Segment {
    int32_t parent = 0;  // id of the segment of the next level that it lies in; 0 on the last one
    int64_t num_gaussians = 0;
    std::array<float, 3> min{}, max{};  // of the Gaussians' means, scene units
  };
  struct Level {
    double scale = 0;               // quantile, [0, 1]
    std::vector<int32_t> ids;       // [num_gaussians] 1.. or 0: in no segment
    std::vector<Segment> segments;  // [k] has the id k + 1; the one with the most Gaussians first
  };
  std::vector<Level> levels;  // in the order of the scales
};

// Parts, objects, groups.
inline constexpr std::array<double, 3> kDefaultDecompositionScales = {0.01, 0.5, 1};
inline constexpr int kMaxLevels = 8;

// INVALID_ARGUMENT: none, more than kMaxLevels, one that is not in [0, 1] or not over the one
// before.
absl::Status CheckDecompositionScales(std::span<const double> scales);
// INVALID_ARGUMENT tells which levels there are.
absl::Status CheckLevel(const Decomposition& decomposition, int level);
// Errors as CheckLevel's; an id that is none on its level.
absl::StatusOr<GaussianSet> MembersOf(const Decomposition& decomposition, int level, int32_t id);

// The level of `scale` from the number of the piece, 0.., that each Gaussian is in; -1: in none.
// Segments are numbered by falling number of Gaussians, of equal ones the one of the lower piece
// first. Parents stay 0.
Decomposition::Level LevelOfPieces(double scale, std::span<const int32_t> pieces,
                                   const Gaussians& gaussians);
// Sets the parents of `fine`, whose segments lie in those of `coarse`.
void SetParents(Decomposition::Level& fine, const Decomposition::Level& coarse);

}  // namespace pepeseg
