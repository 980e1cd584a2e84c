#pragma once

#include <random>
#include <vector>

#include "core/reconstruct/options.h"
#include "core/scene/capture.h"
#include "core/scene/gaussians.h"

namespace pepeseg {

// The Gaussians that stage one starts from (METHOD.md section 1), as in 3DGS.

// Bounds of the logarithm of a Gaussian's standard deviations, which are in scene units.
struct LogScaleBounds {
  float min = 0, max = 0;
};

// Returns 1e-6 and 0.5 of the scene's reach: the larger of SceneRadius and the 90th percentile of
// the points' distances from the centre of the cameras. There must be a point and a view.
LogScaleBounds BoundLogScales(const Capture& capture, const std::vector<ScenePoint>& points);

// Returns the capture's points. A capture without points gets `options.num_random_points` at random
// pixels of the training views, with the pixels' colours, at log-uniform random depths of 0.5 to 10
// scene radii. Returns at most max_gaussians points: of more, every n-th is taken.
std::vector<ScenePoint> StartingPoints(const Capture& capture, const ReconstructOptions& options,
                                       std::mt19937_64& random);

// Returns one isotropic Gaussian for each point. Standard deviation: mean distance to the 3 nearest
// neighbours; a hundredth of the reach where that is 0 (a single point, or several at one place).
// Colour: the point's. Opacity: 0.1.
Gaussians InitialGaussians(const std::vector<ScenePoint>& points, int sh_degree,
                           const LogScaleBounds& bounds);

}  // namespace pepeseg
