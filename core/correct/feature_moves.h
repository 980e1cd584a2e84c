#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/correct/corrected_pixels.h"
#include "core/correct/membership.h"
#include "core/scene/model.h"
#include "kernels/ops/render.h"

namespace pepeseg {

// Numbers by channel of a feature.
using FeatureRow = std::array<float, kFeatureSize>;

// The scales that are corrected, the best one among them, and the price of a change.
struct CorrectedScales {
  std::vector<ScaleFit> fits;
  size_t best = 0;
  FeatureRow price{};  // of a change, by channel
};

// The change that a correction may make to each Gaussian.
struct FeatureMoves {
  std::vector<uint8_t> pull, push;  // [num_gaussians] 0 or 1
};
// A Gaussian outside is pushed if some corrected scale takes it for the thing, or nearly does. One
// inside is pulled if some scale misses it and it is near the thing.
FeatureMoves FindMoves(const Model& model, const CorrectedScales& scales, const ThingPlace& place);

// Moves the features of the Gaussians that are inside (vote > 0) or outside (vote < 0), see
// InsideOrNot, until their cosines to the thing's direction are over the threshold or under it, at
// all corrected scales. Returns the number of Gaussians whose feature has changed.
int64_t MoveFeatures(const CorrectedScales& scales, const FeatureMoves& moves,
                     std::span<const float> votes, FeatureField& field);

}  // namespace pepeseg
