#pragma once

#include <span>

#include "absl/status/statusor.h"
#include "core/decompose/decomposition.h"
#include "core/render/id_image.h"
#include "core/scene/model.h"
#include "kernels/backend.h"

namespace pepeseg {

// Decomposes a model into segments at each scale (METHOD.md section 4, "Decomposition").
//
// HDBSCAN over the gated unit features of up to 16,384 visible Gaussians, at a fine scale, gives
// the smallest pieces. Each Gaussian goes to the piece whose mean is nearest, or to none if that is
// not similar enough. The segments of a granularity level are those of the finer level, or the
// pieces, joined as long as the means of two are similar at the scale of the level; so segments
// nest.
//
// The same model and scales give the same ids. rows: renders blend rows of the model's views.
// Takes the device lock while it clusters. INVALID_ARGUMENT: see CheckDecompositionScales. Other
// errors are those of `rows` and of Hdbscan.
absl::StatusOr<Decomposition> Decompose(Backend& backend, const Model& model,
                                        std::span<const double> scales, RowsOfPixels rows);

}  // namespace pepeseg
