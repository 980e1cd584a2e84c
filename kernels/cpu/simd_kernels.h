#pragma once

#include <cstdint>
#include <span>

#include "kernels/cpu/feature_jobs.h"
#include "kernels/cpu/image_loss_band.h"
#include "kernels/cpu/tree_jobs.h"
#include "kernels/ops/render.h"
#include "kernels/ops/smooth.h"

namespace pepeseg {

// The inner loops of the CPU backend, on raw pointers; kernels/cpu/simd compiles them once for each
// instruction set.

inline constexpr int kTilePixels = 256;  // kTileSize^2

// One tile and the splats that reach it, front to back.
struct TileSplats {
  const Splat* splats;        // [visible]
  const int32_t* entries;     // [count] -> visible
  const int32_t* entry_slot;  // [count] -> slot of the gradient
  int32_t count;
  float x, y;         // of the tile's corner, pixels
  int width, height;  // of its part inside the image, 1..kTileSize
};

// Images of [height, stride] pixels. `alpha` and `depth` may be null.
struct ImageColors {
  int64_t stride;
  const float* background;  // [3]
  float *r, *g, *b, *alpha, *depth, *transmittance;
  int32_t* last;
};
struct ImageGrads {
  int64_t stride;
  const float* background;  // [3]
  const float *r, *g, *b, *alpha, *depth, *transmittance;
  const int32_t* last;
};

// Gaussians [first, first + count) in, those in front of the camera and in reach of the image out.
struct ProjectJob {
  const RenderArgs* args;
  int64_t first;
  int64_t count;
  int32_t* gaussian;  // [count]
  Splat* splat;       // [count]
  int64_t num_out;
  int64_t num_degenerate;
};

// Projection backward of Gaussians [first, first + count), then either Adam or the gradients
// themselves: one of `update` and `grad` is set.
struct ParameterJob {
  const UpdateArgs* update;
  const ProjectBackwardArgs* grad;
  int64_t first;
  int64_t count;
  const Splat* splats;       // [visible]
  const SplatGrad* grads;    // [visible]
  const int32_t* visible;    // [count] -> visible, or -1
  const float* correction1;  // [num_corrections] 1 / (1 - beta1^t), t = 0 unused
  const float* correction2;  // [num_corrections] 1 / sqrt(1 - beta2^t)
  int32_t num_corrections;   // beyond, the last one holds
  int64_t num_skipped;       // out: rows with a gradient that is not finite
};

struct SimdKernels {
  const char* name;
  void (*blend_tile)(const TileSplats& tile, const ImageColors& image);
  // Writes slot_grad[entry_slot[k]] for every entry k.
  void (*blend_tile_backward)(const TileSplats& tile, const ImageGrads& image,
                              SplatGrad* slot_grad);
  // weights [pixels, tile.count] of the entries at some pixels, each once, given as y * kTileSize +
  // x within the tile; 0 where an entry is skipped. All of them in rows 2 n and 2 n + 1.
  void (*pixel_weights)(const TileSplats& tile, std::span<const int32_t> pixels, float* weights);
  // features [N, kFeatureSize], confidence [N] or null -> sums [kTilePixels, kFeatureSize]; see
  // RenderFeaturesArgs.
  void (*blend_features)(const TileSplats& tile, const float* features, const float* confidence,
                         const int32_t* visible_gaussian, float* sums);
  void (*project)(ProjectJob& job);
  void (*update)(ParameterJob& job);
  void (*image_loss_band)(LossBand& band);
  void (*feature_catch_up)(const FeatureCatchUpArgs& args, FeatureRange rows);
  void (*feature_rows)(const FeatureRowsArgs& args, FeatureRange pixels);
  void (*feature_update)(const FeatureUpdateArgs& args, FeatureRange touched);
  void (*smooth_features)(const SmoothFeaturesArgs& args, FeatureRange touched);
  void (*smooth_backward)(const SmoothBackwardArgs& args, FeatureRange touched);
  // The passes of PairLoss over pixels: units, pairs, and back.
  void (*gate_pixels)(const PairJob& job, int first, int end);
  void (*pair_rows)(const PairJob& job, PairBlock& block);
  void (*pair_rows_vjp)(const PairJob& job, PairBlock& block);
  // The passes of PerceptionLoss.
  void (*perception_units)(const PerceptionJob& job, FeatureRange pixels);
  void (*perception_rows)(const PerceptionJob& job, PerceptionBlock& block);
  // query_units: [num_queries, 32] gated and normalised.
  void (*similarity)(const SimilarityArgs& args, const float* query_units, FeatureRange pixels);
  // The passes of SpanningTree; `rows` are at most kNearestRows.
  void (*nearest_neighbours)(const NearestJob& job, FeatureRange rows);
  void (*relax_columns)(const RelaxJob& job, ColumnRange columns);
  // `padded` is a multiple of kTreeColumns; no value is a NaN.
  float (*least_of)(const float* values, int32_t padded);
};

// Of the best instruction set that this machine has.
const SimdKernels& BestSimdKernels();

}  // namespace pepeseg
