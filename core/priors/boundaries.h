#pragma once

#include <cstdint>
#include <vector>

#include "core/scene/capture.h"

namespace pepeseg {

struct PhotoChannels;

// Boundaries in a photograph and in its depth map. All images are [height, width], in reading
// order.

// Returns the boundary strength of each pixel, in [0, 1]: the chi-squared distance between the
// histograms of the two neighbourhoods on either side of it, in the direction in which they differ
// most, at two neighbourhood sizes. After the Pb detector (Martin, Fowlkes and Malik 2004), with
// blurred histograms in place of half discs.
std::vector<float> BoundaryStrength(const PhotoChannels& channels);

// Returns the strength of the jump of `depth` at each pixel, in [0, 1]: 1 from a step of 0.05 on,
// for depths that are normalised to [0, 1]. A slope has 0, as have pixels that touch an unknown
// depth (NaN) and the two outermost scanlines and columns.
std::vector<float> DepthStrength(const std::vector<float>& depth, int width, int height);

// Returns 1 where the view's depth prior jumps or is unknown, else 0: its Canny edges, dilated by
// 5 x 5. The perception loss leaves these pixels out (METHOD.md section 3). The view must have a
// prior.
std::vector<uint8_t> DepthEdges(const View& view);

}  // namespace pepeseg
