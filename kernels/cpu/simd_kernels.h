#pragma once

#include <cstdint>
#include <span>

#include "kernels/cpu/pair_job.h"
#include "kernels/math/hd.h"
#include "kernels/math/match.h"
#include "kernels/math/ssim.h"
#include "kernels/ops/cluster.h"
#include "kernels/ops/feature.h"
#include "kernels/ops/network.h"
#include "kernels/ops/prompt_network.h"
#include "kernels/ops/render.h"
#include "kernels/ops/similarity.h"
#include "kernels/ops/smooth.h"

namespace pepeseg {

// The inner loops of the CPU backend, as a table of functions on raw pointers, and the tasks that
// they work on. kernels/cpu/simd compiles the loops once for each instruction set. All are
// thread-safe for different outputs.

// Rendering and stage one.

inline constexpr int kTilePixels = 256;  // kTileSize^2
// A tile has 16 blocks of 4x4 pixels, row by row, and a block has its pixels row by row. Arrays
// over the pixels of a tile are in this order: an ellipse fills more lanes of such a vector than of
// a row of 16 pixels (81 % and 64 % of them where step_bench blends).
inline constexpr int kBlockSize = 4;  // pixels a side
inline constexpr int kTileBlocks = 16;
inline constexpr int kBlockPixels = kTilePixels / kTileBlocks;

// Returns the index of pixel (x, y) of a tile.
PEPESEG_HD int TilePixel(int x, int y) {
  return (y / kBlockSize * kBlockSize + x / kBlockSize) * kBlockPixels +
         y % kBlockSize * kBlockSize + x % kBlockSize;
}

// One tile and its entries, front to back.
struct TileSplats {
  const Splat* splats;        // [visible]
  const int32_t* entries;     // [count] -> visible
  const int32_t* entry_slot;  // [count] -> slot of the gradient
  int32_t first;              // index of the first of them among all entries
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
  // [entries] a bit for each block of the tile in which the entry was blended, as far as any pixel
  // has seen the entries; null unless for a backward pass.
  uint16_t* entry_blocks;
};
// Inputs of its backward pass: gradients of the colours, alpha and depth, of which the last two may
// be null, and what the render left.
struct ImageGrads {
  int64_t stride;
  const float *r, *g, *b, *alpha, *depth, *transmittance;
  const int32_t* last;
  const uint16_t* entry_blocks;
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

// Gradients of the Gaussians of a block in one step. Adam then reads long runs of each plane, which
// are few streams of memory at a time.
inline constexpr int kUpdateBlock = 256;
struct UpdateBlock {
  alignas(64) float values[NumPlanes(kMaxShDegree)][kUpdateBlock];
  alignas(64) float correction1[kUpdateBlock], correction2[kUpdateBlock];
  uint32_t updated[kUpdateBlock];  // by group, a bit for each lane that Adam moves
};

// Backward pass of the projection of Gaussians [first, first + count), and Adam.
struct ParameterJob {
  const UpdateArgs* update;
  int64_t first;
  int64_t count;
  const UpdateStep* steps;  // [num_steps] of `update`
  int num_steps;
  // By step: [count] -> visible of the step's scratch, or -1.
  const int32_t* visible[kMaxUpdateSteps];
  UpdateBlock* blocks;                   // [num_steps] working memory
  const float* correction1;              // [num_corrections] 1 / (1 - beta1^t), t = 0 unused
  const float* correction2;              // [num_corrections] 1 / sqrt(1 - beta2^t)
  int32_t num_corrections;               // later steps use the last one
  int64_t num_skipped[kMaxUpdateSteps];  // out, by step: rows with a gradient that is not finite
};

inline constexpr int kLossBandRows = 96;  // scanlines of a task, and the granularity of the sums
inline constexpr int kRowMargin = 16;  // zeros on either side of a scanline, >= kLanes and radius
inline constexpr int kRingRows = 2 * kSsimRadius + 1;

// Scanlines [first_row, end_row) of one channel, and the working memory for streaming down them.
// Scanlines are `pitch` floats apart, and pointers are at column 0, after the margin.
struct LossBand {
  const ImageLossArgs* args;
  float l1_weight, ssim_weight;  // of one pixel of one channel: loss weight / count
  int channel, first_row, end_row;
  int pitch;  // width rounded up to 16, and two margins
  // Rings of scanlines, scanline r at r % kRingRows: of the rendered image, of the photograph, and
  // 1, or 0 where the pixel is ignored.
  float *x, *y, *counts;           // [kRingRows, pitch]
  float *squares, *product;        // x^2 + y^2 and x y of a scanline
  float* moment_grad[3];           // gradients of the moments of windows centred on a scanline
  float* moments;                  // [4, kRingRows, pitch] moments filtered across
  float* gathered;                 // [3, kRingRows, pitch] moment_grad filtered across
  double sums[kNumImageLossSums];  // out
};

// Stage two (kernels/cpu/simd/feature.cc, perception_loss.cc, and pair_loss.cc with pair_job.h).

// Data shared by the tasks of one PerceptionLoss.
struct PerceptionJob {
  const PerceptionLossArgs* args;
  int num_scales;
  const float* psi;  // [scales, 32]
  float* unit;       // [S, scales, 32] psi * F, normalised; set only for pixels with a pair
};

// Pixels in [first, end) and their sums. The loss is over ordered pairs, so twice L_p.
struct PerceptionBlock {
  int64_t first, end;
  double loss;
  float psi_grad[kMaxScales * kFeatureSize];
};

// Rows, pixels or touched Gaussians [first, end).
struct FeatureRange {
  int64_t first, end;
};

// SpanningTree (kernels/cpu/simd/spanning_tree.cc). Points are stored as columns in groups of
// kTreeColumns, channel by channel: [groups, 32, kTreeColumns]. Distances are squared.

inline constexpr int kTreeColumns = 16;  // points of a group
inline constexpr int kTreeRows = 8;      // numbers of rows are multiples of this
inline constexpr int kNearestRows = 32;  // rows of a task, for which the columns are read once

struct Neighbour {
  float squared;
  int32_t point;  // -1: none; the distance is then infinite
};

// Finds the nearest neighbours of some points.
struct NearestJob {
  const float* points;   // [num_points, 32]
  const float* columns;  // the same points; the last group's padding is ignored
  int32_t num_points;
  int num_nearest;     // k
  Neighbour* nearest;  // [num_points, k] out: the nearest other points, ascending; none at infinity
};

// Points outside the tree as columns, points that have just joined it as rows.
struct RelaxJob {
  const float* columns;
  const float* core;  // [columns] squared
  // [columns] in and out: the squared length of the least edge to the tree, and its end in the
  // tree.
  float* reach;
  int32_t* from;
  const float* rows;          // [num_rows, 32]
  const float* row_core;      // [num_rows]
  const int32_t* row_points;  // [num_rows]
  int num_rows;               // a multiple of kTreeRows
};

struct ColumnRange {
  int32_t first, end;  // multiples of kTreeColumns
};

// MatchDescriptors (kernels/cpu/simd/match.cc).

inline constexpr int kMatchPadding = 32;  // numbers of columns are padded to a multiple of this
inline constexpr int kMatchPackedWords = kDescriptorBytes / 2;  // int32 of a packed column, at most

// The descriptors of two blocks, one as rows, the other as columns. `padded` is num_columns rounded
// up to kMatchPadding.
struct MatchJob {
  const uint8_t* rows;  // [num_rows, 128]
  int32_t num_rows;
  const uint8_t* columns;  // [num_columns, 128]
  int32_t num_columns;
  bool is_packed;          // whether `packed` and `bias` hold these columns from an earlier job
  void* packed;            // [padded, kMatchPackedWords] int32, working memory
  int32_t* bias;           // [padded] working memory
  int32_t* column_states;  // [3, padded] working memory
  NearestDots* of_row;     // [num_rows] out
  NearestDots* of_column;  // [num_columns] out
};

// Layers of networks (kernels/cpu/simd/network.cc).

inline constexpr int kNetworkRows = 32;  // rows of a task of Linear and Convolve3x3

// products = rows weights, of kNetworkRows rows.
struct RowsProduct {
  int in, out;           // `out` is a multiple of 8
  const float* rows;     // [kNetworkRows, in]
  const float* weights;  // [in, out]
  float* products;       // [kNetworkRows, out] out
};

// Working memory of a task of WindowAttention, padded for any number of lanes.
struct AttentionScratch {
  float keys[kHeadSize][kMaxWindowTokens + 16];  // by channel
  float scores[kMaxWindowTokens + 16];
};

// SAM's decoder (kernels/cpu/simd/prompt.cc). Softmax over the slots of each head, at each of
// kNetworkRows places; weights of padding become 0.
struct SlotSoftmax {
  int num_rows, slots, num_tokens;  // TokenRows and TokenSlots of num_tokens
  const float* bias;                // [num_rows] added to the scores
  float* scores;                    // [num_rows, kNetworkRows] in, weights out
};

// A scanline of a decoded mask.
struct MaskRow {
  const float* logits;  // [count]
  int count;            // a multiple of 32
  int shown;            // cells that show the photograph: the first ones
  int8_t* quarters;     // [count] out: quarters of a logit, rounded, within +-127
  uint32_t* bits;       // [count / 32] out: logit > 0 where the cell is shown
  int32_t* over;        // [3] in and out: adds the shown cells with logits over -1, 0 and 1
};

// SIFT (kernels/cpu/simd/sift.cc). Rows are scanlines that can be read and written up to a multiple
// of 16.

// One scanline of a blur: down over the rows about it into `line`, then across.
struct SiftBlurRow {
  const float* const* rows;  // [2 radius + 1] scanlines, those beyond the border repeated
  const float* taps;         // [radius + 1] at distances 0..radius
  int radius;                // 0..kMaxSiftRadius
  int width;
  float* line;  // working memory, with `radius` floats before it and radius + 16 after its end
  float* out;
};

// A scanline of a difference of Gaussians and what surrounds it.
struct SiftExtremaRow {
  const float* dog[3][3];  // [finer, own, coarser difference][scanline above, own, below]
  int width;               // loads reach 17 floats beyond it
  float threshold;         // least absolute value
};

// A point in a level of an octave, in pixels of which the first has its centre at (0, 0).
struct SiftWindow {
  const float* level;  // [height, stride], with 16 readable floats before it and after its end
  int64_t stride;
  int width, height;
  float x, y, sigma;
};
struct SiftDirection {
  float angle, cosine, sine;  // angle in [0, 2 pi)
};

// The table.
struct SimdKernels {
  const char* name;  // of the instruction set, for reports
  // Blends a tile and writes its part of the images.
  void (*blend_tile)(const TileSplats& tile, const ImageColors& image);
  // Writes slot_grad[entry_slot[k]] for every entry k of the tile.
  void (*blend_tile_backward)(const TileSplats& tile, const ImageGrads& image,
                              SplatGrad* slot_grad);
  // Writes weights[pixels, tile.count] of the entries at some pixels; 0 where an entry is skipped.
  // Pixels are TilePixel(x, y) within the tile, without repeats.
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
  // The passes of PairLoss over pixels, in this order: units, choice of pairs, gradients of the
  // units, gradients. choose_pairs: pairs of the block's pixels, which are rows of the panel, with
  // columns that come after them. gather_pairs: adds to the gradients of rows [first, end) of a
  // panel, which may be the mirrored one; the panel of the first columns starts them.
  void (*gate_pixels)(const PairJob& job, int first, int end);
  void (*choose_pairs)(const PairJob& job, const PairPanel& panel, PairBlock& block);
  void (*gather_pairs)(const PairJob& job, const PairPanel& panel, int first, int end);
  void (*pair_rows_vjp)(const PairJob& job, PairBlock& block);
  // The passes of PerceptionLoss, in this order.
  void (*perception_units)(const PerceptionJob& job, FeatureRange pixels);
  void (*perception_rows)(const PerceptionJob& job, PerceptionBlock& block);
  // query_units: [num_queries, 32], gated and of length 1.
  void (*similarity)(const SimilarityArgs& args, const float* query_units, FeatureRange pixels);
  // The steps of SpanningTree (see above). There are at most kNearestRows `rows`.
  void (*nearest_neighbours)(const NearestJob& job, FeatureRange rows);
  void (*relax_columns)(const RelaxJob& job, ColumnRange columns);
  // Returns the least of `padded` values, a multiple of kTreeColumns, of which none is NaN.
  float (*least_of)(const float* values, int32_t padded);
  // Finds the two largest dot products of each row with the columns, and of each column.
  void (*nearest_descriptors)(const MatchJob& job);
  // Layers of networks. activate: of `count` values, a multiple of 8, in place. depthwise_scanline:
  // scanline y of the output. window_attention: one head of one window.
  void (*multiply_rows)(const RowsProduct& job);
  void (*activate)(Activation activation, float* values, int64_t count);
  void (*depthwise_scanline)(const DepthwiseConvolveArgs& args, int image, int y);
  void (*window_attention)(const WindowAttentionArgs& args, int64_t window, int head,
                           AttentionScratch& scratch);
  // SAM's decoder. normalize_rows: rows of `size` values, a multiple of 16, in place. exp_row:
  // turns `count` scores, a multiple of 16, into exp(score - best), and sums these. mask_logits:
  // cells [count, kMaskChannels] times products [kPromptMasks, kMaskChannels] to [count,
  // kPromptMasks].
  void (*normalize_rows)(const PromptNorm& norm, int size, float epsilon, float* rows, int count);
  void (*exp_row)(float* scores, int count, float& best, float& total);
  void (*softmax_slots)(const SlotSoftmax& job);
  void (*mask_logits)(const float* cells, int count, const float* products, float* logits);
  void (*quantize_mask)(const MaskRow& row);
  void (*blur_sift_row)(const SiftBlurRow& row);
  // Subtracts neighbouring levels: kSiftLevels scanlines in, one less out.
  void (*sift_differences)(const float* const* levels, int width, float* const* out);
  // Writes the columns in [1, width - 1) at which the middle scanline is greater, or less, than all
  // its 26 neighbours. Returns their number, at most width / 2.
  int (*sift_extrema)(const SiftExtremaRow& row, int32_t* columns);
  // Writes the smoothed histogram of directions, [kOrientationBins].
  void (*sift_directions)(const SiftWindow& window, float* histogram);
  // Writes the descriptor, [kSiftDescriptorSize].
  void (*sift_descriptor)(const SiftWindow& window, const SiftDirection& direction,
                          uint8_t* descriptor);
};

// Returns the kernels of the best instruction set that this machine has.
const SimdKernels& BestSimdKernels();

}  // namespace pepeseg
