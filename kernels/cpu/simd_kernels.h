#pragma once

#include <cstdint>
#include <span>

#include "kernels/cpu/feature_jobs.h"
#include "kernels/cpu/image_loss_band.h"
#include "kernels/cpu/tree_jobs.h"
#include "kernels/ops/render.h"
#include "kernels/ops/smooth.h"

namespace pepeseg {

// The inner loops of the CPU backend, as a table of functions on raw pointers. kernels/cpu/simd
// compiles them once for each instruction set. All are thread-safe for different outputs.

inline constexpr int kTilePixels = 256;  // kTileSize^2

// One tile and its entries, front to back.
struct TileSplats {
  const Splat* splats;        // [visible]
  const int32_t* entries;     // [count] -> visible
  const int32_t* entry_slot;  // [count] -> slot of the gradient
  int32_t count;
  float x, y;         // the tile's top left corner, pixels
  int width, height;  // the tile's part inside the image, 1..kTileSize
};

// Outputs of a render, images of [height, stride] pixels. `alpha` and `depth` may be null. `last`
// and `transmittance` are pixel_last_entry and pixel_transmittance of RenderScratch.
struct ImageColors {
  int64_t stride;
  float *r, *g, *b, *alpha, *depth, *transmittance;
  int32_t* last;
};
// Inputs of its backward pass: gradients of the colours, alpha and depth, of which the last two may
// be null, and what the render left.
struct ImageGrads {
  int64_t stride;
  const float *r, *g, *b, *alpha, *depth, *transmittance;
  const int32_t* last;
};

// Projection of Gaussians [first, first + count). The outputs are those in front of the near plane
// and in reach of the image, in their order, without gaps.
struct ProjectJob {
  const RenderArgs* args;
  int64_t first;
  int64_t count;
  int32_t* gaussian;       // [count] out
  Splat* splat;            // [count] out
  int64_t num_out;         // out
  int64_t num_degenerate;  // out: culled because something is not finite or not positive
};

// Backward pass of the projection of Gaussians [first, first + count), and Adam.
struct ParameterJob {
  const UpdateArgs* update;
  int64_t first;
  int64_t count;
  const Splat* splats;       // [visible]
  const SplatGrad* grads;    // [visible]
  const int32_t* visible;    // [count] -> visible, or -1
  const float* correction1;  // [num_corrections] 1 / (1 - beta1^t), t = 0 unused
  const float* correction2;  // [num_corrections] 1 / sqrt(1 - beta2^t)
  int32_t num_corrections;   // later steps use the last one
  int64_t num_skipped;       // out: rows with a gradient that is not finite
};

struct SimdKernels {
  const char* name;  // of the instruction set, for reports
  // Blends a tile and writes its part of the images.
  void (*blend_tile)(const TileSplats& tile, const ImageColors& image);
  // Writes slot_grad[entry_slot[k]] for every entry k of the tile.
  void (*blend_tile_backward)(const TileSplats& tile, const ImageGrads& image,
                              SplatGrad* slot_grad);
  // Writes weights[pixels, tile.count] of the entries at some pixels; 0 where an entry is skipped.
  // Pixels are y * kTileSize + x within the tile, without repeats, at least one, all in scanlines
  // 2 n and 2 n + 1.
  void (*pixel_weights)(const TileSplats& tile, std::span<const int32_t> pixels, float* weights);
  // Blends features [N, kFeatureSize] by weight and confidence, [N] or null, to
  // sums[kTilePixels, kFeatureSize]; see RenderFeaturesArgs.
  void (*blend_features)(const TileSplats& tile, const float* features, const float* confidence,
                         const int32_t* visible_gaussian, float* sums);
  void (*project)(ProjectJob& job);
  void (*update)(ParameterJob& job);
  // Sums and gradients of one band; its working memory must be zero.
  void (*image_loss_band)(LossBand& band);
  void (*feature_catch_up)(const FeatureCatchUpArgs& args, FeatureRange rows);
  void (*feature_rows)(const FeatureRowsArgs& args, FeatureRange pixels);
  void (*feature_update)(const FeatureUpdateArgs& args, FeatureRange touched);
  void (*smooth_features)(const SmoothFeaturesArgs& args, FeatureRange touched);
  void (*smooth_backward)(const SmoothBackwardArgs& args, FeatureRange touched);
  // The passes of PairLoss over pixels, in this order: units, pairs, gradients.
  void (*gate_pixels)(const PairJob& job, int first, int end);
  void (*pair_rows)(const PairJob& job, PairBlock& block);
  void (*pair_rows_vjp)(const PairJob& job, PairBlock& block);
  // The passes of PerceptionLoss, in this order.
  void (*perception_units)(const PerceptionJob& job, FeatureRange pixels);
  void (*perception_rows)(const PerceptionJob& job, PerceptionBlock& block);
  // query_units: [num_queries, 32], gated and of length 1.
  void (*similarity)(const SimilarityArgs& args, const float* query_units, FeatureRange pixels);
  // The steps of SpanningTree (tree_jobs.h). There are at most kNearestRows `rows`.
  void (*nearest_neighbours)(const NearestJob& job, FeatureRange rows);
  void (*relax_columns)(const RelaxJob& job, ColumnRange columns);
  // Returns the least of `padded` values, a multiple of kTreeColumns, of which none is NaN.
  float (*least_of)(const float* values, int32_t padded);
};

// Returns the kernels of the best instruction set that this machine has.
const SimdKernels& BestSimdKernels();

}  // namespace pepeseg
