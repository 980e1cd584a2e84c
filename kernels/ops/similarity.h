#pragma once

#include <cstdint>

#include "kernels/buffer.h"
#include "kernels/half.h"
#include "kernels/ops/render.h"

// Arguments of queries on a cached feature map (METHOD.md section 4). F(p) is the feature of pixel
// p, psi the gate at the scale of the query.

namespace pepeseg {

// cos(psi * F(p), psi * q_k) for a cached feature map and query vectors. 0 where |F(p)| < min_norm:
// little is blended there, or features that have nothing in common.
struct SimilarityArgs {
  DeviceSpan<const Half> map;       // [num_pixels, 32] see RenderFeaturesArgs
  DeviceSpan<const float> psi;      // [32] the gate at the scale of the query
  DeviceSpan<const float> queries;  // [num_queries, 32] features, not yet gated
  float min_norm = 0;               // length of F, not gated
  DeviceSpan<float> similarity;     // [num_queries, num_pixels] in [-1, 1]
};

// Mask of a query (METHOD.md section 4). A pixel is inside if its largest similarity (see
// SimilarityArgs) to the first num_positive queries exceeds both the threshold and its largest
// similarity to the other queries.
struct SegmentPixelsArgs {
  DeviceSpan<const Half> map;         // [num_pixels, 32]
  DeviceSpan<const float> psi;        // [32]
  DeviceSpan<const float> queries;    // [num_queries, 32], at most kMaxQueries; positive ones first
  int num_positive = 1;               // 1..num_queries
  float min_norm = 0;                 // see SimilarityArgs
  float threshold = 0;                // cosine; below 0 pixels under min_norm are inside, too
  DeviceSpan<uint8_t> mask;           // [num_pixels] 0 or 1
  DeviceSpan<float> similarity = {};  // [num_pixels] the largest positive one; empty: not written
  DeviceSpan<int64_t> sums;           // [kNumSegmentSums]
};
inline constexpr int kMaxQueries = 256;
enum SegmentSum {
  kNumInside,      // pixels in the mask
  kSimilaritySum,  // sum over them of round(similarity * kSimilarityUnit): exact in any order
  kNumSegmentSums
};
inline constexpr float kSimilarityUnit = 1 << 20;

// Moves the border of a mask by at most one pixel (METHOD.md section 4, "Borders"). A pixel that
// has a pixel of the other side next to it, diagonals included, and a similarity close to the
// threshold joins the side whose gated feature and colour, of the pixels nearby, it resembles more.
// It stays unless the evidence is clear. Other pixels do not change.
struct RefineBorderArgs {
  int width = 0, height = 0;
  DeviceSpan<const Half> map;          // [height, width, 32]
  DeviceSpan<const float> color;       // [3, height, width] as rendered, clamped to [0, 1] here
  DeviceSpan<const float> psi;         // [32]
  DeviceSpan<const float> similarity;  // [height, width] of SegmentPixels
  float threshold = 0;                 // cosine, of SegmentPixels
  DeviceSpan<const uint8_t> mask;      // [height, width] 0 or 1
  DeviceSpan<uint8_t> refined;         // [height, width] 0 or 1
  DeviceSpan<int64_t> sums;  // [kNumSegmentSums] those of `mask`, become those of `refined`
};

// Packs a mask, so that an eighth of its bytes goes to the host. Bit i % 32 of word i / 32 is pixel
// i; the bits after the last pixel are 0.
struct PackMaskArgs {
  DeviceSpan<const uint8_t> mask;  // [num_pixels] 0 or 1
  DeviceSpan<uint32_t> bits;       // [NumMaskWords(num_pixels)]
};
constexpr int64_t NumMaskWords(int64_t num_pixels) { return (num_pixels + 31) / 32; }

// Compares the masks of one query at many scales and thresholds. The threshold level of a pixel at
// a scale is the number of thresholds that its largest similarity to the first num_positive queries
// exceeds, or 0 if another query is at least as similar. The mask at threshold t is the pixels with
// a level above t. Limits are not checked.
struct LevelOverlapsArgs {
  DeviceSpan<const Half> map;       // [num_pixels, 32]
  DeviceSpan<const float> psi;      // [num_scales, 32], at most kMaxLevelScales
  DeviceSpan<const float> queries;  // [num_queries, 32], at most kMaxQueries; positive ones first
  int num_positive = 1;             // 1..num_queries
  DeviceSpan<const float> thresholds;  // [num_thresholds] ascending, at most kMaxThresholds
  float min_norm = 0;                  // see SimilarityArgs
  DeviceSpan<uint8_t> levels;          // [num_scales, num_pixels] 0..num_thresholds
  // [num_scales, num_scales, num_thresholds + 1, num_thresholds + 1] number of pixels by their
  // levels at two scales, the first scale not above the second; 0 where it is above. Pixels of
  // level 0 at both scales are not counted.
  DeviceSpan<int32_t> overlaps;
};
inline constexpr int kMaxLevelScales = 32;
inline constexpr int kMaxThresholds = 15;

}  // namespace pepeseg
