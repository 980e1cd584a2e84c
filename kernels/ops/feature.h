#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "kernels/buffer.h"
#include "kernels/ops/render.h"

// Arguments of the steps of stage two (METHOD.md section 3) and of queries (section 4). Geometry
// is frozen: a sampled pixel is its row of (Gaussian, weight), see CaptureRowsArgs.

namespace pepeseg {

inline constexpr int kGateSize = 2 * kFeatureSize;  // W[32], then b[32]: psi(s) = sigmoid(W s + b)
inline constexpr int kMaxScales = 16;

// Sparse rows over Gaussians: of the sampled pixels of one view, with what is blended of each, or
// of Gaussians, with those that they are smoothed with.
struct RowSpan {
  DeviceSpan<const int32_t> first;     // [S + 1]
  DeviceSpan<const int32_t> gaussian;  // [entries]
  DeviceSpan<const float> weight;      // [entries], or empty: 1
};

// The same entries by Gaussian: what a Gaussian's gradient is gathered from.
struct ColumnSpan {
  DeviceSpan<const int32_t> gaussian;  // [touched] ascending: those with an entry
  DeviceSpan<const int32_t> first;     // [touched + 1]
  DeviceSpan<const int32_t> pixel;     // [entries] -> row, ascending within a Gaussian
  DeviceSpan<const float> weight;      // [entries], or empty: 1
};

// Transposes groups of rows, each for itself, with the columns of a group following those of the
// one before it. num_groups * num_gaussians must be under 2^31.
struct TransposeRowsArgs {
  RowSpan rows;
  // On the host: the row where each group begins, and the number of rows. Empty: one group.
  std::span<const int32_t> group_first = {};  // [groups + 1]
  int64_t num_gaussians = 0;
  Buffer<int32_t>* gaussian = nullptr;  // ColumnSpan's, sized by the op
  Buffer<int32_t>* first = nullptr;
  Buffer<int32_t>* pixel = nullptr;  // counted from the first row of the group
  Buffer<float>* weight = nullptr;   // not written where the rows have none
  // On the host: the column where each group begins, and the number of columns; may be null.
  std::vector<int32_t>* group_column = nullptr;  // [groups + 1]
};

// Features with their optimiser. Adam is lazy and exact: a row that no sample touches for k steps
// is left alone, and moved by what its moments would have done when it is next read. With epsilon
// far below sqrt(moment2), k steps of zero gradient move a parameter by
//   -rate * moment1 / (sqrt(moment2) + epsilon) * sum_{j=1..k} (beta1 / sqrt(beta2))^j c(t + j),
//   c(t) = sqrt(1 - beta2^t) / (1 - beta1^t),
// where the sum is one number for a whole row. It is cut where its terms fall below float's
// resolution, after kMaxReplay steps.
struct FeatureState {
  DeviceSpan<float> features;          // [N, 32] in and out
  DeviceSpan<float> moment1, moment2;  // [N, 32] in and out
  DeviceSpan<int32_t> last_step;       // [N] in and out: the step a row is up to date with
};
struct FeatureRates {
  float learning_rate = 2.5e-3f;
  float beta1 = 0.9f, beta2 = 0.999f, epsilon = 1e-15f;
  DeviceSpan<const float> correction;  // [steps + 1] c(t) above; c(0) is not read
};
inline constexpr int kMaxReplay = 256;

// Brings rows up to date with `step`.
struct FeatureCatchUpArgs {
  DeviceSpan<const int32_t> gaussian;  // ascending; empty: every row
  FeatureRates rates;
  int step = 0;  // updates done so far
  FeatureState state;
};

// F(p) = sum over the row of weight * feature.
struct FeatureRowsArgs {
  RowSpan rows;
  DeviceSpan<const float> features;  // [N, 32]
  DeviceSpan<float> pixel_features;  // [S, 32]
};

// The losses on a batch of sampled pixels, at several scales at once.
//
// L_m: G^s_pq = 1 iff the label bitsets of p and q at scale s intersect; C^s_pq is the cosine of
// psi(s) * F(p) and psi(s) * F(q). Pairs p < q count with all their scales: those whose G is not
// the same at all scales ("hard"); for each of them easy_share constant-positive and easy_share
// constant-negative ones, drawn at random (as for 5 % of all pairs when fewer are hard); and every
// pair with G = 1 and C < min_positive or G = 0 and C > max_negative at some scale. L_m = mean over
// their positives of (-w C) + mean over their negatives of (w max(C, 0)); w_pq is the product of
// the two pixels' weights, min-max normalised over all pairs of the batch to [1, 10], or 1 when all
// are equal.
//
// The norm of pixels: mean of (|F(p)| - 1)^2 over pixels with alpha > min_norm_alpha.
struct PairLossArgs {
  DeviceSpan<const float> pixel_features;  // [S, 32]
  DeviceSpan<const float> pixel_weight;    // [S] 1 / A(p)
  DeviceSpan<const float> pixel_alpha;     // [S] accumulated alpha
  DeviceSpan<const int32_t> pixel_patch;   // [S] -> patch: pixels with the same labels
  DeviceSpan<const uint64_t> labels;       // [num_scales, num_patches, label_words]
  int num_patches = 0;
  int label_words = 1;
  DeviceSpan<const float> scales;  // [num_scales] quantile scales, in [0, 2]; at most kMaxScales
  DeviceSpan<const float> gate;    // [kGateSize]
  float min_positive = 0.75f;
  float max_negative = 0.5f;
  float easy_share = 0.5f;
  float min_norm_alpha = 0.9f;
  uint32_t pair_seed = 0;        // counter-based draw of the easy pairs
  DeviceSpan<float> pixel_grad;  // [S, 32]
  DeviceSpan<float> gate_grad;   // [kGateSize]
  DeviceSpan<double> sums;       // [kNumPairLossSums]
};
enum PairLossSum {
  kPositiveLoss,  // sums, to be divided by the counts
  kNegativeLoss,
  kNumPositives,  // (pair, scale)
  kNumNegatives,
  kNormLoss,
  kNumNormPixels,
  kNumPairLossSums
};

// L_c at one scale: mean of (1 - C) over the pixels whose nearest centroid has C > min_cosine, with
// C the cosine of psi(s) * F(p) and the centroid. Centroids are constants. Adds to the gradients.
struct CentroidLossArgs {
  DeviceSpan<const float> pixel_features;  // [S, 32]
  DeviceSpan<const float> centroids;       // [K, 32] of length 1, gated; K >= 1
  DeviceSpan<const float> gate;            // [kGateSize]
  float scale = 1;                         // quantile scale
  float min_cosine = 0.9f;
  float weight = 1;              // of the term
  DeviceSpan<float> pixel_grad;  // [S, 32] added to
  DeviceSpan<float> gate_grad;   // [kGateSize] added to
  DeviceSpan<double> sums;       // [kNumCentroidSums]
};
enum CentroidSum { kCentroidLoss, kNumNearCentroids, kNumCentroidSums };

// Backward through the rows, the norm of Gaussians and Adam, in one pass over the Gaussians that
// the batch touches. Their mean of (|f| - 1)^2 stands for the mean over all: the same in
// expectation where Gaussians are touched equally often, and it leaves alone those never seen.
struct FeatureUpdateArgs {
  ColumnSpan columns;
  DeviceSpan<const float> pixel_grad;  // [S, 32] of the columns' rows
  // What the columns gather is the gradient of f / |f|, see SmoothFeatures, rather than of f.
  bool of_direction = false;
  DeviceSpan<const float> gate_grad;  // [kGateSize]
  FeatureRates rates;
  float norm_weight = 1;
  int step = 1;        // of this update, from 1; the touched rows are up to date with step - 1
  FeatureState state;  // in and out
  DeviceSpan<float> gate, gate_moment1, gate_moment2;  // [kGateSize] in and out
};

// cos(psi * F(p), psi * q_k) for a cached feature map and query vectors; 0 where |F| is under
// min_norm: little is blended there, or things that have nothing in common.
struct SimilarityArgs {
  DeviceSpan<const Half> map;       // [num_pixels, 32]
  DeviceSpan<const float> psi;      // [32] the gate at the asked scale
  DeviceSpan<const float> queries;  // [num_queries, 32] features, not yet gated
  float min_norm = 0;
  DeviceSpan<float> similarity;  // [num_queries, num_pixels]
};

// The mask of a question: a pixel is in where its best similarity, see SimilarityArgs, to the first
// num_positive queries is over the threshold and over its best to the others.
struct SegmentPixelsArgs {
  DeviceSpan<const Half> map;       // [num_pixels, 32]
  DeviceSpan<const float> psi;      // [32]
  DeviceSpan<const float> queries;  // [num_queries, 32], at most kMaxQueries
  int num_positive = 1;             // 1..num_queries
  float min_norm = 0;
  float threshold = 0;
  DeviceSpan<uint8_t> mask;           // [num_pixels] 0 or 1
  DeviceSpan<float> similarity = {};  // [num_pixels] the best positive one; may be empty
  DeviceSpan<int64_t> sums;           // [kNumSegmentSums]
};
inline constexpr int kMaxQueries = 256;
enum SegmentSum {
  kNumInside,      // pixels in the mask
  kSimilaritySum,  // over them, of similarity * kSimilarityUnit, rounded: in any order the same
  kNumSegmentSums
};
inline constexpr float kSimilarityUnit = 1 << 20;

// The masks of a question at many scales and thresholds, compared. A pixel's level at a scale is
// the number of thresholds that its best similarity to the first num_positive queries is over, and
// 0 where one of the others is as near; a mask is the pixels over a level.
struct LevelOverlapsArgs {
  DeviceSpan<const Half> map;          // [num_pixels, 32]
  DeviceSpan<const float> psi;         // [num_scales, 32]
  DeviceSpan<const float> queries;     // [num_queries, 32], at most kMaxQueries
  int num_positive = 1;                // 1..num_queries
  DeviceSpan<const float> thresholds;  // [num_thresholds] ascending, at most kMaxThresholds
  float min_norm = 0;
  DeviceSpan<uint8_t> levels;  // [num_scales, num_pixels]
  // [num_scales, num_scales, num_thresholds + 1, num_thresholds + 1] pixels by their levels at two
  // scales, where the first is not the larger index, else 0; of level 0 at both none are counted.
  DeviceSpan<int32_t> overlaps;
};
inline constexpr int kMaxLevelScales = 32;
inline constexpr int kMaxThresholds = 15;

}  // namespace pepeseg
