#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/dataset/capture_checks.h"
#include "core/scene/capture.h"

// Compares depth maps with the points of a dataset, which are in front of the cameras at known
// depths.
namespace pepeseg {

// Returns Spearman's rank correlation, in [-1, 1], between the values of a map, which covers the
// image of the camera at any resolution, and the depths of the points that the camera sees there.
// Points that others hide disturb it little. NaN in the map is unknown. Returns nothing if there
// are fewer than 20 points with a known value, or if all values or all depths are the same.
std::optional<double> DepthCorrelation(const FloatImage& map, const PosedLens& camera,
                                       std::span<const ScenePoint> points);

// Corrects the kind of the views' depth priors if their files hold the other one: disparity in
// depth/, or depth in disparity/. Maps of one kind are judged together, by the mean correlation
// with the points. Returns warnings: of maps that were corrected, that hardly agree with the
// points, or that no points can confirm. Priors made from the points themselves are not examined.
std::vector<std::string> CorrectDepthKinds(std::span<View* const> views,
                                           std::span<const ScenePoint> points);

}  // namespace pepeseg
