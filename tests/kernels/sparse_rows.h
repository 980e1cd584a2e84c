#pragma once

#include <vector>

#include "tests/kernels/rendered.h"

namespace pepeseg {

// Renders a scene and captures the rows of some pixels.
struct SparseRows {
  SparseRows(Backend& backend, Rendered& scene, const std::vector<int32_t>& at)
      : pixels(backend, std::span<const int32_t>(at)) {
    scene.Render();
    CaptureRowsArgs args;
    args.pixels = pixels.span();
    args.scratch = &scene.scratch;
    args.row_first = &first;
    args.entry_gaussian = &gaussian;
    args.entry_weight = &weight;
    backend.CaptureRows(args);
  }
  RowSpan span() const { return {first.span(), gaussian.span(), weight.span()}; }

  Buffer<int32_t> pixels, first, gaussian;
  Buffer<float> weight;
};

// The columns of some rows.
struct SparseColumns {
  SparseColumns(Backend& backend, const RowSpan& rows, int64_t num_gaussians) {
    TransposeRowsArgs args;
    args.rows = rows;
    args.num_gaussians = num_gaussians;
    args.gaussian = &gaussian;
    args.first = &first;
    args.pixel = &pixel;
    args.weight = &weight;
    backend.TransposeRows(args);
  }
  ColumnSpan span() const { return {gaussian.span(), first.span(), pixel.span(), weight.span()}; }

  Buffer<int32_t> gaussian, first, pixel;
  Buffer<float> weight;
};

// Returns every `stride`-th pixel of a view.
inline std::vector<int32_t> EveryPixel(const PinholeView& view, int stride) {
  std::vector<int32_t> pixels;
  for (int i = 0; i < view.width * view.height; i += stride) pixels.push_back(i);
  return pixels;
}

}  // namespace pepeseg
