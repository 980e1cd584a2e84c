#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "kernels/buffer.h"
#include "kernels/ops/render.h"

// Sparse rows of (Gaussian, weight), and arguments of the ops that make and transpose them
// (METHOD.md section 3, "Rows"). N is the number of Gaussians, S the number of sampled pixels.
// "entries" counts the (pixel, Gaussian) pairs, "touched" the Gaussians with an entry.

namespace pepeseg {

// Sparse rows over Gaussians: of the sampled pixels of a view, with the Gaussians that are blended
// there, or of Gaussians, with the neighbours that they are smoothed with.
struct RowSpan {
  DeviceSpan<const int32_t> first;     // [S + 1] first entry of each row
  DeviceSpan<const int32_t> gaussian;  // [entries]
  DeviceSpan<const float> weight;      // [entries]; empty: all are 1
};

// The same entries by Gaussian, from which the gradient of a Gaussian is gathered.
struct ColumnSpan {
  DeviceSpan<const int32_t> gaussian;  // [touched] ascending
  DeviceSpan<const int32_t> first;     // [touched + 1] first entry of each column
  DeviceSpan<const int32_t> pixel;     // [entries] -> row, ascending within a column
  DeviceSpan<const float> weight;      // [entries]; empty: all are 1
};

// Rows of the blend matrix for sampled pixels: the colour (or feature) of a pixel is the sum over
// its row of weight * value[Gaussian], over black. Runs after a Render with the same
// scratch, which need not be for backward. Exact: the order and thresholds are Render's. The host
// waits for the number of entries.
struct CaptureRowsArgs {
  DeviceSpan<const int32_t> pixels;      // [S] y * width + x, in [0, H * W); repeats are allowed
  RenderScratch* scratch = nullptr;      // only read
  Buffer<int32_t>* row_first = nullptr;  // [S + 1] first entry of each row; sized by the op
  Buffer<int32_t>* entry_gaussian = nullptr;  // [entries] front to back; sized by the op
  Buffer<float>* entry_weight = nullptr;      // [entries] alpha_i T_i, above 0; sized by the op
  DeviceSpan<float> pixel_alpha = {};  // [S] sum of the weights of the row; empty: not written
  // [S] sum of weight * z, not normalised, in scene units even after a render of inverse depth;
  // empty: not written.
  DeviceSpan<float> pixel_depth = {};
};

// Transposes groups of rows. Each group is transposed by itself; its columns follow those of the
// group before it. num_groups * num_gaussians must be below 2^31. The host waits for the sizes.
struct TransposeRowsArgs {
  RowSpan rows;
  // On the host: the first row of each group, then the end of the last. Empty: one group of all.
  std::span<const int32_t> group_first = {};  // [groups + 1] ascending
  int64_t num_gaussians = 0;                  // N; entries of `rows` are below it
  Buffer<int32_t>* gaussian = nullptr;        // the arrays of a ColumnSpan, sized by the op
  Buffer<int32_t>* first = nullptr;
  Buffer<int32_t>* pixel = nullptr;  // relative to the first row of the group
  Buffer<float>* weight = nullptr;   // not written if the rows have no weights
  // On the host: the first column of each group, then the number of columns; may be null.
  std::vector<int32_t>* group_column = nullptr;  // [groups + 1]
};

}  // namespace pepeseg
