#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/statusor.h"
#include "core/render/model_renderer.h"

namespace pepeseg {

// Where the rows of a view's pixels (y * width + x) come from.
using RowsOfPixels =
    absl::FunctionRef<absl::StatusOr<PixelRows>(const ModelView&, std::span<const int32_t>)>;

// The segment that each pixel of a view shows, [height, width]: of the ids of its Gaussians
// ([num_gaussians], 0: in no segment) the one with the largest sum of blend weights, of equal ones
// the smallest. 0 where the accumulated weight is under a half, or the Gaussians in no segment have
// the largest sum. Errors are those of `rows`, which is asked for some rows of pixels at a time.
absl::StatusOr<std::vector<int32_t>> RenderIds(const ModelView& view, std::span<const int32_t> ids,
                                               RowsOfPixels rows);

}  // namespace pepeseg
