#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>

#include "core/scene/gaussians.h"

namespace pepeseg {

struct NewColor {
  Eigen::Vector3d color = Eigen::Vector3d::Zero();  // R, G, B in [0, 1]
  double strength = 1;                              // share of it, in (0, 1]
};

// Multiplies the colour of a Gaussian, in each direction, by a factor for each channel.
void ScaleColor(const Eigen::Array3d& factor, int64_t row, Gaussians& gaussians);

// Gives the Gaussians with the indices `rows` another colour. With strength 1 the colour c of a
// Gaussian, in each direction, becomes `color` * Y(c) / Y: Y(c) is its luminance (Rec. 709), Y the
// mean luminance of all, by their opacities. So their mean becomes `color`, and shades and
// highlights stay. Of a thing darker than 0.05, Y(c) is raised by what Y lacks. There must be a
// row.
void RecolorGaussians(const NewColor& to, std::span<const int64_t> rows, Gaussians& gaussians);

}  // namespace pepeseg
