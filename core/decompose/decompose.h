#pragma once

#include <span>

#include "absl/status/statusor.h"
#include "core/decompose/decomposition.h"
#include "core/render/id_image.h"
#include "core/scene/model.h"
#include "kernels/backend.h"

namespace pepeseg {

// Takes a model apart (METHOD.md section 4, "Decomposition"). HDBSCAN over the gated unit features,
// at the finest scale, of 16,384 Gaussians that the views show gives the smallest pieces; every
// Gaussian goes to the nearest of their means, or to none where that is not alike. A level's
// segments are those of the level before, the first one's the pieces, joined while the means of two
// are alike at the level's scale: so they nest. The same model and scales give the same ids.
// INVALID_ARGUMENT as CheckDecompositionScales; errors of `rows`.
absl::StatusOr<Decomposition> Decompose(Backend& backend, const Model& model,
                                        std::span<const double> scales, RowsOfPixels rows);

}  // namespace pepeseg
