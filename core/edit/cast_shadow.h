#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "core/edit/hole_picture.h"

namespace pepeseg {

// The shadow of a thing in a picture of a flat surface.
struct CastShadow {
  std::vector<float> share;         // [height, width] in [0, 1]; empty: there is none
  Eigen::Array3d gain = {1, 1, 1};  // what the light is worth: lit colour / colour in the shadow

  // Returns the factor on the colour of a pixel without the shadow.
  Eigen::Array3d GainAt(size_t pixel) const { return 1 + share[pixel] * (gain - 1); }
};

// Finds the shadow of the thing that stands on `foot`, [height, width] 0 or 1, in the known pixels
// of a picture whose values are R, G, B. It is what is darker than most around it (Otsu's threshold
// of the logarithms of luminance), touches the foot, does not leave the picture, is at
// most six times as large as the foot, and differs from what is lit next to it by nearly the same
// factor in each channel: a shadow takes no colour away. Both must have little texture: among other
// things there is none to be found.
CastShadow FindShadow(const HolePicture& picture, std::span<const uint8_t> foot);

}  // namespace pepeseg
