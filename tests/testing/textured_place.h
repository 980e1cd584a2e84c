#pragma once

#include <string>
#include <vector>

#include "core/scene/capture.h"
#include "tests/testing/ray_scene.h"

namespace pepeseg::testing {

// A place with texture all over, for what looks for features in photographs: boxes before a wall,
// in noise of several sizes that is fixed to them. Another seed is another place.
std::vector<View> PhotographPlace(const ViewArc& arc, uint32_t seed);

// `arc`'s usual: 320x240 pixels, so many views over 0.12 of an angle each.
ViewArc PlaceArc(int num_views);

// The mean over the pixels about each, up to `radius` away: out of focus.
Image Blurred(const Image& photo, int radius);

}  // namespace pepeseg::testing
