#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/scene/capture.h"

// The masks that stage two learns from: their sizes in space, and which of them count at a scale
// (METHOD.md section 2 and section 3, "Labels"). A mask cell is a set of pixels under the same
// masks, a cell of MaskSet.

namespace pepeseg {

inline constexpr float kNoScale = 0;         // scale of a mask that takes no part
inline constexpr int kNumScaleKnots = 1000;  // length of FeatureField::scale_quantiles

// Returns whether stage two learns from a view.
inline bool IsTrained(const View& view) { return !view.held_out && !view.masks.empty(); }
// Returns the indices of these views in the capture, ascending.
std::vector<int> TrainedViews(const Capture& capture);

// Returns the bitset of the masks of a mask cell, [masks.words]. 0 <= cell < masks.num_cells().
inline std::span<const uint64_t> CellBits(const MaskSet& masks, size_t cell) {
  const auto words = static_cast<size_t>(masks.words);
  return std::span(masks.cell_bits).subspan(cell * words, words);
}

// Calls fn(mask) for each mask in a bitset over a view's masks, ascending.
template <class Fn>
void ForEachMaskIn(std::span<const uint64_t> bits, Fn fn) {
  for (size_t word = 0; word < bits.size(); ++word) {
    for (uint64_t left = bits[word]; left != 0; left &= left - 1) {
      fn(static_cast<int>(64 * word) + std::countr_zero(left));
    }
  }
}

// Returns the size of each mask of a view in space (GARField, equation 2), scene units:
// 2 sqrt(var X + var Y + var Z) of its pixels after a 3x3 majority filter, back-projected with
// `depth` [height, width]. Pixels with depth 0 (unknown) and ignored pixels are left out. kNoScale
// for a mask with fewer than 8 pixels left. `depth` may be empty if the view has no masks.
std::vector<float> MaskScales(const View& view, std::span<const float> depth);

// Returns the median scale, the larger of two in the middle. `scales` must not be empty.
float MedianScale(std::vector<float> scales);

// Return the scale in scene units at the query scales 0, 1 / 999, ..., 1: kNumScaleKnots values,
// ascending. Scales that are not over 0 are left out; empty if none is left.
//
// ScaleQuantiles: the quantiles of the scales, linear between the sorted scales.
std::vector<float> ScaleQuantiles(std::vector<float> scales);
// EvenScales: even steps from the smallest scale to the 99th percentile. The largest scale is not
// the end, so that one stray mask does not stretch the range.
std::vector<float> EvenScales(std::vector<float> scales);
// MinMaxScales: even steps from the smallest scale to the largest.
std::vector<float> MinMaxScales(std::vector<float> scales);

// Computes the label of a mask cell at a scale, as a bitset over the view's masks: the masks of the
// cell that are smaller than `scale`, and the finest of its other masks. Two pixels belong together
// (G = 1) if and only if their labels intersect. Masks without a scale take no part.
//
// cell_bits: [words] of the cell, see CellBits. mask_scales: [num_masks] scene units. scale:
// scene units. out: [words], overwritten.
void ScaleLabels(std::span<const uint64_t> cell_bits, std::span<const float> mask_scales,
                 float scale, std::span<uint64_t> out);

}  // namespace pepeseg
