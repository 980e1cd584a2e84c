#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "core/scene/capture.h"
#include "tests/testing/ray_scene.h"

namespace pepeseg::testing {

// Renders photographs of a place that has texture everywhere, for methods that match features
// between photographs: boxes in front of a wall, covered by noise of several sizes. Another `seed`
// is another place.
std::vector<View> PhotographPlace(const ViewArc& arc, uint32_t seed);
// Renders the photographs of these views.
std::vector<View> PhotographPlace(std::vector<View> views, uint32_t seed);

// Returns an arc of `num_views` views of 320x240 pixels, with 0.12 radians for each.
ViewArc PlaceArc(int num_views);

// Returns views from one spot, of which each is turned by 0.08 radians, and tilted.
std::vector<View> PlaceTurn(int num_views);

// Returns the photograph out of focus: each pixel is the mean of those up to `radius` away.
Image Blurred(const Image& photo, int radius);

// Returns the similarity (rotation, scale, translation) that moves estimated camera centres best to
// the true ones, at least three. S. Umeyama, "Least-squares estimation of transformation parameters
// between two point patterns", PAMI 1991.
Eigen::Matrix4d FitSimilarity(std::span<const Eigen::Vector3d> estimated,
                              std::span<const Eigen::Vector3d> truth);
// Returns the error of estimated camera centres after FitSimilarity: the root mean square distance,
// divided by the root mean square distance of the true centres from their mean.
double CenterError(std::span<const Eigen::Vector3d> estimated,
                   std::span<const Eigen::Vector3d> truth);

}  // namespace pepeseg::testing
