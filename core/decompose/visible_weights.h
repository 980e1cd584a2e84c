#pragma once

#include <vector>

#include "absl/status/statusor.h"
#include "core/render/id_image.h"
#include "core/scene/model.h"

namespace pepeseg {

// How much of each Gaussian a model's views show: the sum of its blend weights over a grid of
// pixels of at most 32 views, spread evenly, [num_gaussians]. Ones when the model has no views.
// Errors are those of `rows`.
absl::StatusOr<std::vector<float>> VisibleWeights(const Model& model, RowsOfPixels rows);

}  // namespace pepeseg
