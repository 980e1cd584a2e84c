#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/statusor.h"
#include "core/render/model_renderer.h"

namespace pepeseg {

// Returns the blend rows of some pixels of a view, y * width + x.
using RowsOfPixels =
    absl::FunctionRef<absl::StatusOr<PixelRows>(const ModelView&, std::span<const int32_t>)>;

// Returns the segment that each pixel of a view shows, [height, width]: the id with the largest sum
// of blend weights, or the smallest of several such ids. 0 where the weights sum to less than a
// half or where Gaussians in no segment have the largest sum. ids: the segment of each Gaussian,
// [num_gaussians], 0: none. Calls `rows` for bands of pixels, to limit memory, and returns its
// error.
absl::StatusOr<std::vector<int32_t>> RenderIds(const ModelView& view, std::span<const int32_t> ids,
                                               RowsOfPixels rows);

}  // namespace pepeseg
