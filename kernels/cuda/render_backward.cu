#include <cuda_runtime.h>

#include "kernels/cuda/blend_tile.cuh"
#include "kernels/cuda/cuda_backend.h"

// RenderBackward (RenderBackwardArgs in kernels/ops/render.h): from the gradients of the pixels to
// those of the splats, by the formulas of kernels/math/blend.h. Two launches.
//
// BackwardKernel: one warp, a block of its own, per bucket of up to 128 entries of one tile;
// a lane owns eight pixels of the tile, one in each cell. It goes through the entries from back to
// front in groups of 32, whose splats are in shared memory (WarpBatch; __syncwarp before and after
// they are replaced). For each entry the lanes compute the terms of their pixels, and shuffles sum
// them over the warp (SumOverWarp). The sums of an entry go to its slot. Buckets are independent,
// because the forward pass has stored the state of each pixel at their ends (render.cu).
// Transmittances before a splat are recovered by division by 1 - alpha >= 0.01.
//
// SumSlotsKernel: six threads per splat, two numbers of its slots each. They add the slots of
// the splat, which are its tiles from the top left, in registers; shared memory and one
// __syncthreads hand the sums to one thread per splat, which turns them into gradients.
//
// No float is added by an atomic. A slot is written by one warp, as a tree over lanes of sums over
// the cells in their order, and slots are added in their order: gradients are the same in every
// run.

namespace pepeseg {
namespace {

// Sums each of N values over the 32 lanes of a warp. At each of five levels a lane gives half of
// its values to its partner and takes over the other half, so that 10 values take 12 shuffles and
// not 50. Afterwards value[0] of a lane is sum number IndexOfSum<N>(lane), and the other values are
// unspecified. All 32 lanes must call it. The order of each sum is a fixed tree, so results are the
// same in every run.
template <int N, int kOffset = 16>
__device__ void SumOverWarp(float (&value)[N], int lane) {
  constexpr int kHalf = (N + 1) / 2;
  float half[kHalf];
  const bool upper = (lane & kOffset) != 0;
#pragma unroll
  for (int i = 0; i < kHalf; ++i) {
    if (i + kHalf < N) {
      const float give = upper ? value[i] : value[i + kHalf];
      const float keep = upper ? value[i + kHalf] : value[i];
      half[i] = keep + __shfl_xor_sync(0xffffffffu, give, kOffset);
    } else {
      half[i] = value[i] + __shfl_xor_sync(0xffffffffu, value[i], kOffset);
    }
  }
  if constexpr (kOffset > 1) SumOverWarp<kHalf, kOffset / 2>(half, lane);
  value[0] = half[0];
}

// The sum, in [0, N), that a lane holds after SumOverWarp. Several lanes may hold the same sum; its
// bits are then equal, as float addition is commutative.
template <int N, int kOffset = 16>
__device__ int IndexOfSum(int lane) {
  constexpr int kHalf = (N + 1) / 2;
  int index = 0;
  if constexpr (kOffset > 1) index = IndexOfSum<kHalf, kOffset / 2>(lane);
  return (lane & kOffset) != 0 && index + kHalf < N ? index + kHalf : index;
}

// Sums over the pixels of a (splat, tile) entry: the moments of PowerMoments, the gradients of the
// colour, the squares of SplatGrad, and the gradient of the depth.
enum SlotSum {
  kSum,
  kSumX,
  kSumY,
  kSumXX,
  kSumXY,
  kSumYY,
  kSumR,
  kSumG,
  kSumB,
  kSumSquares,
  kSumDepth,
  kNumSlotSums
};
static_assert(kNumSlotSums <= kSlotSize);

struct BackwardParams {
  TileView tiles;
  Room room;
  int num_tiles;
  const int32_t* entry_slot;
  const int32_t* entry_visible;
  const int32_t* tile_first_bucket;
  const int32_t* bucket_tile;
  const int32_t* pixel_last_entry;
  const float4* pixel_color;
  const float* pixel_depth;
  const float4* bucket_color;
  const float* bucket_depth;
  const float *color_grad, *alpha_grad, *depth_grad;  // the last two may be null, and are not read
                                                      // without kShape
  float* slot_sums;                                   // [entries, kSlotSize]
};

// State of a pixel while the entries are taken from back to front.
struct PixelState {
  float r_grad, g_grad, b_grad, depth_grad;  // gradients of the pixel, constant
  // Behind the next entry. The other two are behind_dot of AlphaVjp: that of the colour, and that
  // of depth and alpha.
  float transmittance, behind, shape_behind;
  int32_t end;  // end of the entries of the tile that the pixel has blended; 0: it has no gradient
};

// State of the lane's pixel of a cell at the end of the bucket. kShape: depth or alpha has a
// gradient.
template <bool kShape>
__device__ PixelState StartPixel(const BackwardParams& p, int tile, int bucket, int cell) {
  const int lane = static_cast<int>(threadIdx.x) % 32;
  const int x = tile % p.tiles.num_tiles_x * kTileSize + CellX(cell) + lane % kCellWidth;
  const int y = tile / p.tiles.num_tiles_x * kTileSize + CellY(cell) + lane / kCellWidth;
  PixelState s = {};
  if (x >= p.tiles.width || y >= p.tiles.height) return s;
  const int64_t num_pixels = int64_t{p.tiles.width} * p.tiles.height;
  const int64_t pixel = int64_t{y} * p.tiles.width + x;
  const int32_t first = (bucket - p.tile_first_bucket[tile]) * kBucketSize;
  s.end = p.pixel_last_entry[pixel];
  if (s.end <= first) {
    s.end = 0;
    return s;
  }
  s.r_grad = p.color_grad[pixel];
  s.g_grad = p.color_grad[num_pixels + pixel];
  s.b_grad = p.color_grad[2 * num_pixels + pixel];
  float alpha_grad = 0;
  if constexpr (kShape) {
    s.depth_grad = p.depth_grad == nullptr ? 0 : p.depth_grad[pixel];
    alpha_grad = p.alpha_grad == nullptr ? 0 : p.alpha_grad[pixel];
  }
  if (s.r_grad == 0 && s.g_grad == 0 && s.b_grad == 0 && s.depth_grad == 0 && alpha_grad == 0) {
    s.end = 0;  // no gradient: the pixel is ignored, or equals the photograph
    return s;
  }
  const int64_t in_tiles = int64_t{tile} * kTilePixels + cell * 32 + lane;
  const float4 all = p.pixel_color[in_tiles];
  s.transmittance = all.w;
  s.shape_behind = -alpha_grad;
  if (s.end <= first + kBucketSize) return s;
  // The pixel has also blended entries behind this bucket. What it gathered there is
  // the difference of its state at the end of the tile and at the end of the bucket;
  // divided by the transmittance there it is as seen with transmittance 1.
  s.end = first + kBucketSize;
  const int64_t in_buckets = int64_t{bucket} * kTilePixels + cell * 32 + lane;
  const float4 before = p.bucket_color[in_buckets];
  s.behind = __fdividef(
      s.r_grad * (all.x - before.x) + s.g_grad * (all.y - before.y) + s.b_grad * (all.z - before.z),
      before.w);
  if constexpr (kShape) {
    float gathered = all.w * s.shape_behind;
    if (p.depth_grad != nullptr) {
      gathered += s.depth_grad * (p.pixel_depth[in_tiles] - p.bucket_depth[in_buckets]);
    }
    s.shape_behind = __fdividef(gathered, before.w);
  }
  s.transmittance = before.w;
  return s;
}

// One splat at one pixel, (dx, dy) from its mean: takes the state in front of the splat and adds to
// the lane's sums.
template <bool kShape>
__device__ void BackwardPixel(const SplatWords& w, float alpha, float dx, float dy, PixelState& s,
                              float (&sums)[kShape ? kNumSlotSums : kNumSlotSums - 1]) {
  s.transmittance = __fdividef(s.transmittance, 1 - alpha);
  const float value = w.b.z * s.r_grad + w.b.w * s.g_grad + w.c.x * s.b_grad;
  float grad = GaussianVjp(alpha, AlphaVjp(s.transmittance, value, s.behind));
  s.behind = BehindStep(alpha, value, s.behind);
  sums[kSumSquares] += grad * grad;
  if constexpr (kShape) {
    const float depth = w.c.y * s.depth_grad;
    grad += GaussianVjp(alpha, AlphaVjp(s.transmittance, depth, s.shape_behind));
    s.shape_behind = BehindStep(alpha, depth, s.shape_behind);
  }
  const float weight = BlendStep(alpha, s.transmittance).weight;
  const float grad_x = grad * dx, grad_y = grad * dy;
  sums[kSum] += grad;
  sums[kSumX] += grad_x;
  sums[kSumY] += grad_y;
  sums[kSumXX] += grad_x * dx;
  sums[kSumXY] += grad_x * dy;
  sums[kSumYY] += grad_y * dy;
  sums[kSumR] += weight * s.r_grad;
  sums[kSumG] += weight * s.g_grad;
  sums[kSumB] += weight * s.b_grad;
  if constexpr (kShape) sums[kSumDepth] += weight * s.depth_grad;
}

__device__ void ZeroSlot(const BackwardParams& p, int32_t slot) {
  float2* out = reinterpret_cast<float2*>(p.slot_sums + int64_t{slot} * kSlotSize);
#pragma unroll
  for (int k = 0; k < kSlotSize / 2; ++k) out[k] = {0, 0};
}

constexpr int kBackwardWarps = 1;  // warps a block; they share nothing

// Shared memory of a warp: the splats of 32 entries, as SplatWords.
struct WarpBatch {
  float4 a[32], b[32], c[32];
};

// Writes the slots of all entries of a bucket, zeros for those that no pixel has blended. The grid
// covers the upper bound of the number of buckets; warps beyond the number return at once.
template <bool kShape>
__global__ void __launch_bounds__(32 * kBackwardWarps) BackwardKernel(BackwardParams p) {
  constexpr int kNumSums = kShape ? kNumSlotSums : kNumSlotSums - 1;
  __shared__ WarpBatch batches[kBackwardWarps];
  const int lane = static_cast<int>(threadIdx.x) % 32;
  WarpBatch& batch = batches[threadIdx.x / 32];
  const int bucket = static_cast<int>(blockIdx.x) * kBackwardWarps + threadIdx.x / 32;
  if (bucket >= p.tile_first_bucket[p.num_tiles] || p.room.IsVoid()) return;
  const int tile = p.bucket_tile[bucket];
  const int32_t tile_first = p.tiles.tile_first_entry[tile];
  const int32_t first = (bucket - p.tile_first_bucket[tile]) * kBucketSize;
  const int32_t num_entries =
      min(p.tiles.tile_first_entry[tile + 1] - tile_first - first, kBucketSize);
  const float tile_x = tile % p.tiles.num_tiles_x * kTileSize + 0.5f;
  const float tile_y = tile / p.tiles.num_tiles_x * kTileSize + 0.5f;
  const float x = tile_x + lane % kCellWidth, y = tile_y + lane / kCellWidth;

  PixelState pixels[kNumCells];
  int32_t last = 0;
#pragma unroll
  for (int cell = 0; cell < kNumCells; ++cell) {
    pixels[cell] = StartPixel<kShape>(p, tile, bucket, cell);
    last = max(last, pixels[cell].end);
  }
  last = __reduce_max_sync(kAllLanes, last) - first;  // from it on no pixel has blended an entry
  const int sum_index = IndexOfSum<kNumSums>(lane);

  for (int32_t group = (num_entries - 1) / 32 * 32; group >= 0; group -= 32) {
    const int32_t own = group + lane;
    const int32_t entry = tile_first + first + own;
    const int32_t slot = own < num_entries ? p.entry_slot[entry] : -1;
    uint32_t own_cells = 0;
    __syncwarp();
    if (own < min(last, num_entries)) {
      const SplatWords w = LoadSplat(p.tiles.splats, p.entry_visible[entry]);
      batch.a[lane] = w.a;
      batch.b[lane] = w.b;
      batch.c[lane] = w.c;
      own_cells = ReachedCells(MakeSplatExtent(ToSplat(w)), tile_x - w.a.x, tile_y - w.a.y);
    }
    __syncwarp();
    if (group >= last) {  // the same for all lanes
      if (slot >= 0) ZeroSlot(p, slot);
      continue;
    }
    for (int k = min(31, num_entries - 1 - group); k >= 0; --k) {
      const uint32_t cells = __shfl_sync(kAllLanes, own_cells, k);
      const int32_t its_slot = __shfl_sync(kAllLanes, slot, k);
      float sums[kNumSums] = {};
      bool any = false;
      if (cells != 0) {
        const SplatWords w = {batch.a[k], batch.b[k], batch.c[k]};
        const float dx0 = x - w.a.x, dy0 = y - w.a.y;
        const PowerRoot<float> root = {w.a.z, w.a.w, w.b.x};
        const int32_t position = first + group + k;
#pragma unroll
        for (int cell = 0; cell < kNumCells; ++cell) {
          if ((cells >> cell & 1) == 0) continue;
          const float dx = dx0 + CellX(cell), dy = dy0 + CellY(cell);
          const float power = Power(root.xx, PowerAtRow(root, dy), dx);
          if (power < w.c.z || position >= pixels[cell].end) continue;
          any = true;
          BackwardPixel<kShape>(w, Alpha(w.b.y, FastExp2(power)), dx, dy, pixels[cell], sums);
        }
      }
      if (__any_sync(kAllLanes, any)) SumOverWarp(sums, lane);
      float* out = p.slot_sums + int64_t{its_slot} * kSlotSize;
      out[sum_index] = sums[0];
      if (!kShape && lane == 31) out[kSumDepth] = 0;
    }
  }
}

constexpr int kSumParts = kSlotSize / 2;  // threads per splat, two sums each
constexpr int kSplatsABlock = 64;
constexpr int kSlotsAtOnce = 4;  // loads in flight at once

struct SumParams {
  Room room;
  const int32_t* first_slot;
  const Splat* splats;
  const float* slot_sums;
  bool inverse_depth;
  SplatGrad* visible_grad;
};

// Sums over the tiles of a splat, in the order of its slots, and writes visible_grad.
__global__ void __launch_bounds__(kSplatsABlock* kSumParts) SumSlotsKernel(SumParams p) {
  __shared__ float2 shared[kSplatsABlock][kSumParts];
  if (p.room.IsVoid()) return;
  const int64_t num_visible = p.room.counters[kNumVisible];
  const int64_t block_first = int64_t{blockIdx.x} * kSplatsABlock;
  const int thread = static_cast<int>(threadIdx.x);
  const int64_t own = block_first + thread / kSumParts;
  const int part = thread % kSumParts;
  float2 sum = {0, 0};
  if (own < num_visible) {
    const float2* slots = reinterpret_cast<const float2*>(p.slot_sums) + part;
    const int64_t end = p.first_slot[own + 1];
    for (int64_t slot = p.first_slot[own]; slot < end; slot += kSlotsAtOnce) {
      float2 some[kSlotsAtOnce];
#pragma unroll
      for (int k = 0; k < kSlotsAtOnce; ++k) {
        some[k] = slot + k < end ? slots[(slot + k) * kSumParts] : float2{0, 0};
      }
#pragma unroll
      for (int k = 0; k < kSlotsAtOnce; ++k) {
        sum.x += some[k].x;
        sum.y += some[k].y;
      }
    }
  }
  shared[thread / kSumParts][part] = sum;
  __syncthreads();
  if (thread >= kSplatsABlock || block_first + thread >= num_visible) return;
  const int64_t visible = block_first + thread;
  const float* sums = &shared[thread][0].x;
  const Splat& splat = p.splats[visible];
  const PowerMoments<float> moments = {sums[kSum],   sums[kSumX],  sums[kSumY],
                                       sums[kSumXX], sums[kSumXY], sums[kSumYY]};
  const auto shape = SplatShapeVjp(PowerRoot<float>{splat.root_xx, splat.root_xy, splat.root_yy},
                                   splat.opacity, moments);
  const float depth_grad =
      p.inverse_depth ? InverseDepthVjp(splat.depth, sums[kSumDepth]) : sums[kSumDepth];
  p.visible_grad[visible] = {shape.x,        shape.y,       shape.conic_xx,   shape.conic_xy,
                             shape.conic_yy, shape.opacity, sums[kSumR],      sums[kSumG],
                             sums[kSumB],    depth_grad,    sums[kSumSquares]};
}

}  // namespace

// The host does not know how many buckets there are: the grid has the upper bound.
void CudaBackend::RenderBackward(const RenderBackwardArgs& args) {
  const Turn turn(*this);
  if (!turn) return;
  RenderScratch& scratch = *args.scratch;
  if (!scratch.for_backward) return Fail({"RenderBackward: the render was not made for it", true});
  const int64_t num_visible = scratch.visible_splat.size();
  scratch.cuda.slot_sums.Reserve(*this, scratch.entry_slot.size() * kSlotSize);
  scratch.visible_grad.Reserve(*this, num_visible);
  if (!error_.empty() || num_visible == 0) return;
  const int num_tiles = scratch.num_tiles_x * scratch.num_tiles_y;
  const BackwardParams params = {
      TilesOf(scratch),
      RoomOf(scratch),
      num_tiles,
      scratch.entry_slot.span().data,
      scratch.entry_visible.span().data,
      scratch.cuda.tile_first_bucket.span().data,
      scratch.cuda.bucket_tile.span().data,
      scratch.pixel_last_entry.span().data,
      reinterpret_cast<const float4*>(scratch.cuda.pixel_color.span().data),
      scratch.cuda.pixel_depth.span().data,
      reinterpret_cast<const float4*>(scratch.cuda.bucket_color.span().data),
      scratch.cuda.bucket_depth.span().data,
      args.color_grad.data,
      args.alpha_grad.data,
      args.depth_grad.data,
      scratch.cuda.slot_sums.span().data};
  const int64_t num_buckets = MaxBuckets(scratch.entry_slot.size(), num_tiles);
  const int num_blocks = NumBlocks(num_buckets, kBackwardWarps);
  if (args.depth_grad.empty() && args.alpha_grad.empty()) {
    BackwardKernel<false><<<num_blocks, 32 * kBackwardWarps, 0, stream_>>>(params);
  } else {
    BackwardKernel<true><<<num_blocks, 32 * kBackwardWarps, 0, stream_>>>(params);
  }
  Launched("blend backward");
  SumSlotsKernel<<<NumBlocks(num_visible, kSplatsABlock), kSplatsABlock * kSumParts, 0, stream_>>>(
      {RoomOf(scratch), scratch.visible_first_slot.span().data, scratch.visible_splat.span().data,
       scratch.cuda.slot_sums.span().data, scratch.inverse_depth,
       scratch.visible_grad.span().data});
  Launched("sum slots");
}

}  // namespace pepeseg
