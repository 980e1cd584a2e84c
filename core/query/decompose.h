#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/query/decomposition.h"
#include "core/render/renderer.h"
#include "core/scene/model.h"
#include "kernels/backend.h"

namespace pepeseg {

// Returns the blend rows of some pixels of a view, y * width + x.
using RowsOfPixels =
    absl::FunctionRef<absl::StatusOr<PixelRows>(const ModelView&, std::span<const int32_t>)>;

// Decomposes a model into segments at each scale (METHOD.md section 4, "Decomposition").
//
// HDBSCAN over the gated unit features of up to 16,384 visible Gaussians, at a fine scale, gives
// the smallest pieces. Each Gaussian goes to the piece whose mean is nearest, or to none if that is
// not similar enough. The segments of a granularity level are those of the finer level, or the
// pieces, joined as long as the means of two are similar at the scale of the level; so segments
// nest. At scale 0 nothing is joined: each piece is split by HDBSCAN over up to 2,048 of its own
// Gaussians, of which the sample of the whole model has few.
//
// The same model and scales give the same ids. rows: renders blend rows of the model's views.
// Takes the device lock while it clusters. INVALID_ARGUMENT: see CheckDecompositionScales. Other
// errors are those of `rows` and of Hdbscan.
absl::StatusOr<Decomposition> Decompose(Backend& backend, const Model& model,
                                        std::span<const double> scales, RowsOfPixels rows);

// Clusters directions agglomeratively, by their centroids. As long as the largest cosine between
// two pieces is over `join_cosine`, these two are joined and their sums added; of equal cosines the
// pair with the lowest numbers comes first. A sum of zeros is never joined.
//
// sums: [num_pieces, 32], the direction of each piece; its length is its weight. Returns the new
// number of each piece, from 0, in the order of the first pieces of the clusters. Memory grows with
// the square of num_pieces, time with its square times the number of joins at worst.
std::vector<int32_t> JoinPieces(std::span<const float> sums, double join_cosine);

}  // namespace pepeseg
