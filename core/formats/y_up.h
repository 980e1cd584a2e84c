#pragma once

#include <array>

#include "kernels/gaussian_planes.h"

namespace pepeseg {

// glTF and SPZ have y up and z towards the viewer. The world of most datasets, and with it PLY
// files of Gaussians, has y down and z away from the viewer, as COLMAP's cameras do. An export to
// these formats turns the world by 180 degrees about x: x, -y, -z. Each parameter of a Gaussian
// keeps its size and is multiplied by 1 or -1.

// Signs of a position.
inline constexpr std::array<float, 3> kYUpMean = {1, -1, -1};
// Signs of a rotation w, x, y, z. Both the world and the Gaussian's own axes are turned, of which
// the latter changes no ellipsoid.
inline constexpr std::array<float, 4> kYUpRotation = {1, 1, -1, -1};
// Signs of the SH coefficients of a channel, in the order of the planes: -1 where the basis
// function (METHOD.md section 1) changes its sign with y and z.
inline constexpr std::array<float, NumShCoefficients(kMaxShDegree)> kYUpSh = {
    1,                         // degree 0
    -1, -1, 1,                 // y, z, x
    -1, 1,  1,  -1, 1,         // xy, yz, 2 zz - xx - yy, xz, xx - yy
    -1, 1,  -1, -1, 1, -1, 1,  // y(3 xx - yy), xyz, y(4 zz - xx - yy), z(2 zz - 3 xx - 3 yy),
                               // x(4 zz - xx - yy), z(xx - yy), x(xx - 3 yy)
};

}  // namespace pepeseg
