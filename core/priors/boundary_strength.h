#pragma once

#include <vector>

#include "core/priors/photo_channels.h"

namespace pepeseg {

// How much what is on both sides of each pixel differs, in the direction in which it differs most:
// the chi-squared distance of the histograms of two neighbourhoods, at two sizes of these (after
// Martin, Fowlkes and Malik's Pb, 2004, with blurred histograms in place of half discs).
// [height, width], in [0, 1].
std::vector<float> BoundaryStrength(const PhotoChannels& channels);

// Likewise of a depth map [height, width], NaN where nothing is known: the jump relative to the
// spread of all depths, at most 1.
std::vector<float> DepthStrength(const std::vector<float>& depth, int width, int height);

}  // namespace pepeseg
