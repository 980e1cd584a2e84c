#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "kernels/buffer.h"
#include "kernels/ops/render.h"

// Arguments of the steps of stage two (METHOD.md section 3) and of queries (section 4). Geometry
// is frozen, so a sampled pixel is its row of (Gaussian, weight), see CaptureRowsArgs.
//
// N is the number of Gaussians, S the number of sampled pixels. "touched" counts the Gaussians with
// an entry, "entries" the (pixel, Gaussian) pairs. F(p) is the feature of pixel p, psi(s) the gate
// at scale s. As in kernels/ops/render.h, arguments are borrowed until the op has run, and outputs
// are overwritten and overlap nothing unless a field says otherwise.

namespace pepeseg {

// Numbers of a gate of one layer, W[32] and b[32], and of one of two layers; see
// kernels/math/gate.h. The size of `gate` in the arguments says which of the two it is; its
// gradient and moments have the same layout and size.
inline constexpr int kGateSize = 2 * kFeatureSize;
inline constexpr int kTwoLayerGateSize = 2 * 32 + (32 + 1) * kFeatureSize;
inline constexpr int kMaxScales = 16;

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

// Features and the state of their optimiser. Adam is lazy and exact: a row that no sample touches
// for k steps is left alone, and moved by what its moments would have done when it is next read.
// With epsilon far below sqrt(moment2), k steps with gradient zero, after step t, move a parameter
// by
//   -rate * moment1 / (sqrt(moment2) + epsilon) * sum_{j=1..k} (beta1 / sqrt(beta2))^j c(t + j),
//   c(t) = sqrt(1 - beta2^t) / (1 - beta1^t),
// where the sum is one number for a whole row. It is cut after kMaxReplay steps, where its terms
// fall below the resolution of float.
struct FeatureState {
  DeviceSpan<float> features;          // [N, 32] in and out
  DeviceSpan<float> moment1, moment2;  // [N, 32] in and out
  DeviceSpan<int32_t> last_step;       // [N] in and out: the step that a row is up to date with
};
// Rates of Adam for features and gate.
struct FeatureRates {
  float learning_rate = 2.5e-3f;
  float beta1 = 0.9f, beta2 = 0.999f, epsilon = 1e-15f;
  // [steps + 1] c(t) as above, times the factor of a learning rate schedule if there is one. c(0)
  // is not read.
  DeviceSpan<const float> correction;
};
inline constexpr int kMaxReplay = 256;

// Brings rows up to date with `step`.
struct FeatureCatchUpArgs {
  DeviceSpan<const int32_t> gaussian;  // ascending, without repeats; empty: every row
  FeatureRates rates;
  int step = 0;        // number of updates so far; no row may be ahead of it
  FeatureState state;  // in and out
};

// F(p) = sum over the row of weight * feature. The rows must have weights: the CPU does not take
// empty ones as 1.
struct FeatureRowsArgs {
  RowSpan rows;
  DeviceSpan<const float> features;  // [N, 32]
  DeviceSpan<float> pixel_features;  // [S, 32] F
};

// Contrastive loss L_m on a batch of sampled pixels, at several scales at once, and the norm term
// of pixels. Writes the gradients of L_m + norm term.
//
// G^s_pq = 1 if the label bitsets of p and q at scale s intersect, else 0. C^s_pq is the cosine of
// psi(s) * F(p) and psi(s) * F(q). A pair p < q counts with all its scales if it is one of these:
//   - hard: G is not the same at all scales;
//   - easy: G is the same at all scales, and the pair is drawn at random. For each hard pair,
//     easy_share pairs with G = 1 and easy_share pairs with G = 0 are drawn on average. If fewer
//     than 5 % of all pairs are hard, the draw assumes 5 %;
//   - wrong: G = 1 and C < min_positive, or G = 0 and C > max_negative, at some scale.
// L_m = mean over their positives of (-w C) + mean over their negatives of (w max(C, 0)). w_pq is
// the product of the weights of the two pixels, min-max normalised over all pairs of the batch to
// [1, 10], or 1 if all are equal.
//
// The norm term is the mean of (|F(p)| - 1)^2 over pixels with alpha > min_norm_alpha.
//
// S must be below 65536. The CUDA backend fails if S or the number of scales is out of range; the
// CPU only asserts it.
struct PairLossArgs {
  DeviceSpan<const float> pixel_features;  // [S, 32] F
  DeviceSpan<const float> pixel_weight;    // [S] 1 / A(p), A the mean area of the masks over p
  DeviceSpan<const float> pixel_alpha;     // [S] accumulated alpha
  DeviceSpan<const int32_t> pixel_patch;   // [S] -> mask cell: pixels with the same labels
  DeviceSpan<const uint64_t> labels;       // [num_scales, num_patches, label_words] bitsets
  int num_patches = 0;                     // mask cells of the batch
  int label_words = 1;                     // 64-bit words of a bitset
  DeviceSpan<const float> scales;          // [num_scales] quantile scales in [0, 2]; 1..kMaxScales
  DeviceSpan<const float> gate;            // [kGateSize] or [kTwoLayerGateSize]
  float min_positive = 0.75f;              // cosine
  float max_negative = 0.5f;               // cosine
  float easy_share = 0.5f;                 // see above; >= 0
  float min_norm_alpha = 0.9f;             // [0, 1]
  uint32_t pair_seed = 0;        // of the draw, a hash of the seed and the pair: no state is kept
  DeviceSpan<float> pixel_grad;  // [S, 32] d loss / d F
  DeviceSpan<float> gate_grad;   // as gate
  DeviceSpan<double> sums;       // [kNumPairLossSums]
};
// Sums over the pairs that count, at each scale, and the numbers to divide them by.
enum PairLossSum {
  kPositiveLoss,   // sum of -w C
  kNegativeLoss,   // sum of w max(C, 0)
  kNumPositives,   // number of (pair, scale) with G = 1
  kNumNegatives,   // number of (pair, scale) with G = 0
  kNormLoss,       // sum of (|F(p)| - 1)^2
  kNumNormPixels,  // number of pixels in it
  kNumPairLossSums
};

// Centroid loss L_c at one scale (METHOD.md section 3, "Centroids"): mean of (1 - C) over the
// pixels whose nearest centroid has C > min_cosine, where C is the cosine of psi(s) * F(p) and the
// centroid. Centroids are constants. Adds weight * d L_c to the gradients.
struct CentroidLossArgs {
  DeviceSpan<const float> pixel_features;  // [S, 32] F
  DeviceSpan<const float> centroids;       // [K, 32] gated, of length 1; K >= 1
  DeviceSpan<const float> gate;            // [kGateSize] or [kTwoLayerGateSize]
  float scale = 1;                         // quantile scale
  float min_cosine = 0.9f;                 // [0, 1)
  float weight = 1;                        // factor of the gradients; not of `sums`
  DeviceSpan<float> pixel_grad;            // [S, 32] in and out: added to
  DeviceSpan<float> gate_grad;             // as gate, in and out: added to
  DeviceSpan<double> sums;                 // [kNumCentroidSums]
};
enum CentroidSum {
  kCentroidLoss,      // sum of 1 - C over the pixels near a centroid
  kNumNearCentroids,  // number of those pixels
  kNumCentroidSums
};

// Backward pass through the rows, the norm term of Gaussians and one step of Adam, in one pass over
// the Gaussians that the batch touches. The norm term is norm_weight * mean of (|f| - 1)^2 over the
// touched Gaussians, in place of the mean over all: the same in expectation where Gaussians are
// touched equally often, and it leaves alone those never seen. The gate is updated as well.
struct FeatureUpdateArgs {
  ColumnSpan columns;
  DeviceSpan<const float> pixel_grad;  // [S, 32] gradients of the rows that `columns` refers to
  // True: what a column gathers is the gradient of f / |f|, see SmoothFeaturesArgs, instead of f.
  bool of_direction = false;
  DeviceSpan<const float> gate_grad;  // as gate
  FeatureRates rates;
  float norm_weight = 1;
  int step = 1;        // number of this update, from 1; touched rows are up to date with step - 1
  FeatureState state;  // in and out; the touched rows become up to date with `step`
  DeviceSpan<float> gate, gate_moment1, gate_moment2;  // of one size, in and out
};

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
