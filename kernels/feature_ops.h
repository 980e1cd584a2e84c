#pragma once

#include <cstdint>

#include "kernels/buffer.h"
#include "kernels/ops.h"

// Arguments of the steps of stage two (method.md section 3) and of queries (section 4). Geometry
// is frozen: a sampled pixel is its row of (Gaussian, weight), see CaptureRowsArgs.

namespace pepeseg {

inline constexpr int kGateSize = 2 * kFeatureSize;  // W[32], then b[32]: psi(s) = sigmoid(W s + b)
inline constexpr int kMaxScales = 16;

// Rows of the sampled pixels of one view.
struct RowSpan {
  DeviceSpan<const int32_t> first;     // [S + 1]
  DeviceSpan<const int32_t> gaussian;  // [entries]
  DeviceSpan<const float> weight;      // [entries]
};

// F(p) = sum over the row of weight * feature.
struct FeatureRowsArgs {
  RowSpan rows;
  DeviceSpan<const float> features;  // [N, 32]
  DeviceSpan<float> pixel_features;  // [S, 32]
};

// The scale-aware contrastive loss over pairs of sampled pixels at several scales at once.
// G^s_pq = 1 iff the label bitsets of p and q at scale s intersect; C^s_pq is the cosine of
// psi(s) * F(p) and psi(s) * F(q). L_m = mean over positives of (-w C) + mean over negatives of
// (w max(C, 0)), over the chosen pairs and all scales.
struct PairLossArgs {
  DeviceSpan<const float> pixel_features;  // [S, 32]
  DeviceSpan<const float> gate;            // [kGateSize]
  DeviceSpan<const float> scales;          // [num_scales], in [0, 2]: quantile scales
  DeviceSpan<const uint64_t> labels;       // [num_scales, S, label_words]
  int label_words = 1;
  DeviceSpan<const float> pixel_weight;  // [S] 1 / A(p); w_pq from the product of two
  float min_pair_product = 0;            // of pixel_weight products over the batch: w_pq is their
  float max_pair_product = 0;            // min-max normalisation to [1, 10]; equal: w = 1
  uint64_t pair_seed = 0;                // counter-based draw of the "easy" pairs
  float easy_positive_share = 0;         // probability that a constant-positive pair is drawn
  float easy_negative_share = 0;         // likewise, constant-negative
  DeviceSpan<float> pixel_grad;          // [S, 32]
  DeviceSpan<float> gate_grad;           // [kGateSize]
  DeviceSpan<double> sums;               // [kNumPairLossSums]
};
enum PairLossSum { kPositiveLoss, kNegativeLoss, kNumPositives, kNumNegatives, kNumPairLossSums };

// feature_grad[g] = sum over the entries of g of weight * pixel_grad: by the transposed rows, in a
// fixed order.
struct FeatureRowsBackwardArgs {
  RowSpan rows;
  DeviceSpan<const float> pixel_grad;           // [S, 32]
  Buffer<int32_t>* touched_gaussian = nullptr;  // [touched], ascending, sized by the op
  Buffer<float>* touched_grad = nullptr;        // [touched, 32], sized by the op
};

struct FeatureUpdateArgs {
  DeviceSpan<const int32_t> touched_gaussian;  // [touched]
  DeviceSpan<const float> touched_grad;        // [touched, 32]
  DeviceSpan<const float> gate_grad;           // [kGateSize]
  float learning_rate = 2.5e-3f;
  float beta1 = 0.9f, beta2 = 0.999f, epsilon = 1e-15f;
  int step = 1;                        // of this update, from 1
  DeviceSpan<float> features;          // [N, 32] in and out
  DeviceSpan<float> moment1, moment2;  // [N, 32] in and out
  DeviceSpan<int32_t> last_step;       // [N] in and out: the step a row is up to date with
  DeviceSpan<float> gate;              // [kGateSize] in and out
  DeviceSpan<float> gate_moment1, gate_moment2;
};

// cos(psi * F(p), psi * q_k) for a cached feature map and query vectors; 0 where F is 0.
struct SimilarityArgs {
  DeviceSpan<const Half> map;       // [num_pixels, 32]
  DeviceSpan<const float> psi;      // [32] the gate at the asked scale
  DeviceSpan<const float> queries;  // [num_queries, 32] features, not yet gated
  DeviceSpan<float> similarity;     // [num_queries, num_pixels]
};

}  // namespace pepeseg
