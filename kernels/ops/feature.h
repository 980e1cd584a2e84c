#pragma once

#include <cstdint>

#include "kernels/buffer.h"
#include "kernels/ops/rows.h"

// Arguments of the steps of stage two (METHOD.md section 3). Geometry is frozen, so a sampled pixel
// is its row of (Gaussian, weight), see CaptureRowsArgs.
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
// L_m = mean over their positives of (-w C) + mean over their negatives of
// (w max(C - negative_margin, 0)). With joint_mean it is one mean over both, and easy pairs with
// G = 1 and with G = 0 are drawn with the same probability, as many in all. w_pq is the product of
// the weights of the two pixels, min-max normalised over all pairs of the batch to [1, 10], or 1 if
// all are equal.
//
// The norm term is the mean of (|F(p)| - 1)^2 over pixels with alpha > min_norm_alpha.
//
// S must be below 65536. The CUDA backend fails if S or the number of scales is out of range; the
// CPU only asserts it.
struct PairLossArgs {
  DeviceSpan<const float> pixel_features;  // [S, 32] F
  DeviceSpan<const float> pixel_weight;    // [S] 1 / A(p), A the mean area of the masks over p
  DeviceSpan<const float> pixel_alpha;     // [S] accumulated alpha
  DeviceSpan<const int32_t> pixel_cell;    // [S] -> mask cell: pixels with the same labels
  DeviceSpan<const uint64_t> labels;       // [num_scales, num_cells, label_words] bitsets
  int num_cells = 0;                       // mask cells of the batch
  int label_words = 1;                     // 64-bit words of a bitset
  DeviceSpan<const float> scales;          // [num_scales] quantile scales in [0, 2]; 1..kMaxScales
  DeviceSpan<const float> gate;            // [kGateSize] or [kTwoLayerGateSize]
  float min_positive = 0.75f;              // cosine
  float max_negative = 0.5f;               // cosine
  float negative_margin = 0;               // cosine, in [0, 1); see above
  float easy_share = 0.5f;                 // see above; >= 0
  float min_norm_alpha = 0.9f;             // [0, 1]
  bool joint_mean = false;                 // see above
  uint32_t pair_seed = 0;        // of the draw, a hash of the seed and the pair: no state is kept
  DeviceSpan<float> pixel_grad;  // [S, 32] d loss / d F
  DeviceSpan<float> gate_grad;   // as gate
  DeviceSpan<double> sums;       // [kNumPairLossSums]
};
// Sums over the pairs that count, at each scale, and the numbers to divide them by.
enum PairLossSum {
  kPositiveLoss,   // sum of -w C
  kNegativeLoss,   // sum of w max(C - negative_margin, 0)
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

// Cues of colour and depth for a pair of pixels, at all scales: bit k is set if the pair is similar
// at scale k, bit kDissimilarShift + k if it is dissimilar. Where both are set, similar
// wins.
using PairCues = uint32_t;
inline constexpr int kDissimilarShift = 16;
static_assert(kMaxScales <= kDissimilarShift);
// Perception loss L_p (METHOD.md section 3, "Perception loss"): mean over scales of [mean over
// similar pairs of (1 - C) + mean over dissimilar pairs of max(C, 0)], where C is the cosine of
// psi(s) * F(p) and psi(s) * F(q). Which pairs there are does not depend on any feature, so they
// are listed, and their numbers known, in advance. Adds weight * d L_p to the gradients.
struct PerceptionLossArgs {
  DeviceSpan<const float> pixel_features;  // [S, 32] F
  // The pairs by pixel; each pair is listed twice, under either of its pixels.
  DeviceSpan<const int32_t> first;  // [S + 1] first entry of each pixel
  DeviceSpan<const int32_t> other;  // [entries] the other pixel, in [0, S)
  DeviceSpan<const PairCues> cues;  // [entries]
  // Weight of a pair at a scale: of similar pairs, then of dissimilar ones. Each is
  // 1 / (num_scales * number of those pairs at that scale).
  DeviceSpan<const float> share;   // [2, num_scales]
  DeviceSpan<const float> scales;  // [num_scales] quantile scales; at most kMaxScales
  DeviceSpan<const float> gate;    // [kGateSize] or [kTwoLayerGateSize]
  float weight = 1;                // factor of the gradients; not of `loss`
  DeviceSpan<float> pixel_grad;    // [S, 32] in and out: added to
  DeviceSpan<float> gate_grad;     // as gate, in and out: added to
  DeviceSpan<double> loss;         // [1] L_p
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

}  // namespace pepeseg
