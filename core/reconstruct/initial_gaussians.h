#pragma once

#include <random>
#include <vector>

#include "core/reconstruct/reconstruct.h"
#include "core/scene/capture.h"
#include "core/scene/gaussians.h"

namespace pepeseg {

struct LogScaleBounds {
  float min = 0, max = 0;
};

// What a Gaussian's standard deviations may be, from the reach of the points and the cameras.
LogScaleBounds BoundLogScales(const Capture& capture, const std::vector<ScenePoint>& points);

// The capture's points or, when it has none, `options.num_random_points` at random pixels of the
// training views, coloured by them, at random depths of 0.5 to 10 scene radii. Never more than
// max_gaussians: of more points, every n-th is taken.
std::vector<ScenePoint> StartingPoints(const Capture& capture, const ReconstructOptions& options,
                                       std::mt19937_64& random);

// One isotropic Gaussian a point, as wide as the mean distance to its 3 nearest neighbours (a
// hundredth of the reach where that is 0: a point alone, or several at one place), of the point's
// colour and opacity 0.1.
Gaussians InitialGaussians(const std::vector<ScenePoint>& points, int sh_degree,
                           const LogScaleBounds& bounds);

}  // namespace pepeseg
