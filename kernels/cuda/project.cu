#include <cuda_runtime.h>

#include "kernels/cuda/cuda_backend.h"
#include "kernels/cuda/device_planes.cuh"
#include "kernels/math/blend.h"
#include "kernels/math/dropout.h"
#include "kernels/math/tile_cover.h"

// First part of Render (RenderArgs in kernels/ops/render.h; METHOD.md section 1, "Rendering"):
// projects the Gaussians (kernels/math/projection.h), shades them (sh.h), counts the tiles that
// each reaches (tile_cover.h), and compacts those that reach one, in the order of their index, in
// one launch.
//
// One thread per Gaussian, 256 neighbouring ones per block. A block takes its number from an atomic
// ticket, so that blocks are numbered in the order in which they start and SumOfBlocksBefore cannot
// wait for a block that has not started. Ranks within a warp come from shuffles, those of the warps
// from shared memory (BlockSums), those of the blocks from a running sum over the launch: one
// over visible Gaussians, by warp 0, one over (Gaussian, tile) entries, by warp 1. __syncthreads
// separates the warps' sums, the blocks' sums and their use.
//
// Everything that is summed or compared across threads is an integer: outputs do not depend on the
// order in which blocks run.

namespace pepeseg {
namespace {

constexpr int kBlock = 256;
constexpr int kNumWarps = kBlock / 32;

// Running sums over the blocks of one launch (Merrill and Garland 2016, decoupled look-back): a
// block learns the sum of the blocks before it without a second launch. Each block has a 64-bit
// word that holds its own sum, then its sum with all blocks before it; the top two bits say which.
// Flag and sum are in one word, which is written whole, so no fence is needed. Words must be 0
// before the launch. Sums are integers below 2^62, and therefore exact in any order.
constexpr uint64_t kHasOwnSum = uint64_t{1} << 62;
constexpr uint64_t kHasRunningSum = uint64_t{2} << 62;
constexpr uint64_t kSumMask = kHasOwnSum - 1;

// Sum over the lanes of a warp, in every lane.
__device__ uint64_t WarpSum(uint64_t value) {
  for (int offset = 16; offset > 0; offset /= 2) {
    value += __shfl_xor_sync(0xffffffffu, value, offset);
  }
  return value;
}

// Publishes a block's own sum and returns the sum of the blocks before it, in every lane. Called by
// one whole warp of each block. It spins until those blocks have published, so blocks must be
// numbered in the order in which they started (by an atomic ticket, not by blockIdx): all blocks
// before are then running or done, and the wait ends.
__device__ uint64_t SumOfBlocksBefore(volatile uint64_t* words, int block, uint64_t own_sum) {
  const int lane = static_cast<int>(threadIdx.x) & 31;
  if (lane == 0) words[block] = own_sum | (block == 0 ? +kHasRunningSum : +kHasOwnSum);
  if (block == 0) return 0;
  uint64_t before = 0;
  for (int end = block;; end -= 32) {
    // Lane k reads the block k + 1 before `end`; lanes ahead of the first block read a sum of 0.
    const int at = end - 1 - lane;
    uint64_t word = at < 0 ? +kHasRunningSum : words[at];
    while (__any_sync(0xffffffffu, word < kHasOwnSum)) {
      if (word < kHasOwnSum) word = words[at];
    }
    const uint32_t running = __ballot_sync(0xffffffffu, word >= kHasRunningSum);
    // The nearest running sum stands for all blocks before it: lanes beyond it do not count.
    const bool counts = running == 0 || lane <= __ffs(running) - 1;
    before += WarpSum(counts ? word & kSumMask : 0);
    if (running != 0) break;
  }
  if (lane == 0) words[block] = (before + own_sum) | kHasRunningSum;
  return before;
}

struct ProjectParams {
  DevicePlanes<const float> gaussians;
  int64_t count;
  ProjectionCamera<float> camera;
  TileGrid grid;
  float width, height;
  float near_plane;
  int sh_degree;
  Dropout dropout;
  // Outputs, each with space for all Gaussians.
  int32_t* gaussian_visible;
  int32_t* visible_gaussian;
  Splat* visible_splat;
  int32_t* visible_first_slot;
  int64_t* counters;
  // [1 + 2 * blocks] zeros: the next ticket, then the words of two running sums.
  uint64_t* progress;
};

// Visible, out of view or too faint, or culled because a value is not usable.
enum class Fate { kVisible, kOutside, kDegenerate };

// Colour of the splat as seen from the camera. Returns whether it is usable. The degree is a
// template argument, so that the loop over the coefficients unrolls and `basis` stays in registers.
template <int kDegree>
__device__ bool ShadeSplat(const ProjectParams& p, int64_t i, Vec3<float> mean, Splat& splat) {
  constexpr int kNumCoefficients = NumShCoefficients(kDegree);
  float basis[kNumCoefficients];
  ShBasis(Normalize(mean - CameraCenter(p.camera)), kDegree, basis);
  float sum[3] = {};
#pragma unroll
  for (int k = 0; k < kNumCoefficients; ++k) {
    for (int c = 0; c < 3; ++c) sum[c] += basis[k] * p.gaussians.At(kShPlane + 3 * k + c, i);
  }
  splat.r = ShChannel(sum[0]);
  splat.g = ShChannel(sum[1]);
  splat.b = ShChannel(sum[2]);
  return IsUsable(splat.r) && IsUsable(splat.g) && IsUsable(splat.b);
}

// Makes the splat of Gaussian i, except for tiles. Unusable values are culled and counted, never
// clamped (NUMERICS.md, "Bounds and rules").
template <int kDegree>
__device__ Fate ProjectOne(const ProjectParams& p, int64_t i, Splat& splat) {
  if (IsLeftOut(p.dropout.share, p.dropout.seed, static_cast<uint32_t>(i))) return Fate::kOutside;
  const GaussianShape<float> shape = LoadShape(p.gaussians, i);
  const float depth = MeanInCam(p.camera, shape.mean).z;
  if (!IsUsable(depth)) return Fate::kDegenerate;
  if (depth <= p.near_plane) return Fate::kOutside;
  const Projection<float> projection = Project(p.camera, shape);
  const Sym2<float> conic = projection.conic;
  const float opacity = OpacityFactor(p.dropout.share) * Sigmoid(p.gaussians.At(kOpacityPlane, i));
  if (!(SquaredNorm(shape.rotation) > kMinSquaredQuaternion) || !IsUsable(projection.x) ||
      !IsUsable(projection.y) || !(projection.determinant > 0) ||
      !IsUsable(projection.determinant) || !IsUsable(conic.xy) || !(conic.xx > 0) ||
      !IsUsable(conic.xx) || !(conic.yy > 0) || !IsUsable(conic.yy) || !IsUsable(opacity)) {
    return Fate::kDegenerate;
  }
  const float min_power = MinPower(opacity);
  if (!(min_power < 0)) return Fate::kOutside;
  const auto root = MakePowerRoot(conic.xx, conic.xy, projection.determinant);
  const auto half = SplatHalfExtent(min_power, root.yy, conic.yy, projection.determinant);
  // Tested before the colour, whose coefficients are most of the memory to read.
  if (projection.x + half.width <= 0 || projection.x - half.width >= p.width ||
      projection.y + half.height <= 0 || projection.y - half.height >= p.height) {
    return Fate::kOutside;
  }
  splat = {projection.x, projection.y, root.xx,    root.xy, root.yy, opacity, 0, 0, 0,
           depth,        min_power,    half.height};
  return ShadeSplat<kDegree>(p, i, shape.mean, splat) ? Fate::kVisible : Fate::kDegenerate;
}

// A slot beyond the range of int is clamped: the 64-bit counters show that the render is too large
// or has overflowed, and then no slot is used.
__device__ int32_t ToSlot(uint64_t slot) {
  return static_cast<int32_t>(min(slot, uint64_t{INT32_MAX}));
}

// Number of visible Gaussians (0 or 1 for a thread) and of their entries.
struct Counts {
  uint32_t visible, entries;
};

// Shared memory of a block.
struct BlockSums {
  Counts warp[kNumWarps];                   // sums of the warps
  uint64_t visible_before, entries_before;  // sums of the blocks before
  uint32_t largest_depth;                   // as its bits
  int block;                                // number of this block, in the order of starting
};

// Sum of the lanes before this one, and the total of the warp.
__device__ Counts WarpExclusiveSum(Counts own, Counts& total) {
  const int lane = static_cast<int>(threadIdx.x) & 31;
  Counts sum = own;
  for (int offset = 1; offset < 32; offset *= 2) {
    const uint32_t visible = __shfl_up_sync(0xffffffffu, sum.visible, offset);
    const uint32_t entries = __shfl_up_sync(0xffffffffu, sum.entries, offset);
    if (lane >= offset) {
      sum.visible += visible;
      sum.entries += entries;
    }
  }
  total = {__shfl_sync(0xffffffffu, sum.visible, 31), __shfl_sync(0xffffffffu, sum.entries, 31)};
  return {sum.visible - own.visible, sum.entries - own.entries};
}

// Finds the sums of the blocks before: warp 0 for the visible, warp 1 for the entries. The last
// block also stores the totals.
__device__ void SumOverBlocks(const ProjectParams& p, BlockSums& sums) {
  const int num_blocks = static_cast<int>(gridDim.x);
  const int warp = static_cast<int>(threadIdx.x) / 32;
  if (warp >= 2) return;
  uint64_t own = 0;
  for (int w = 0; w < kNumWarps; ++w) {
    own += warp == 0 ? sums.warp[w].visible : sums.warp[w].entries;
  }
  const uint64_t before = SumOfBlocksBefore(p.progress + 1 + warp * num_blocks, sums.block, own);
  if (threadIdx.x % 32 != 0) return;
  (warp == 0 ? sums.visible_before : sums.entries_before) = before;
  if (sums.block != num_blocks - 1) return;
  p.counters[warp == 0 ? kNumVisible : kNumTileEntries] = static_cast<int64_t>(before + own);
}

// Each thread stores its splat at its rank among the visible, and the first of its entries.
template <int kDegree>
__global__ void __launch_bounds__(kBlock) ProjectKernel(ProjectParams p) {
  __shared__ BlockSums sums;
  if (threadIdx.x == 0) {
    sums.largest_depth = 0;
    sums.block =
        static_cast<int>(atomicAdd(reinterpret_cast<unsigned long long*>(p.progress), 1ull));
  }
  __syncthreads();
  const int64_t i = int64_t{sums.block} * kBlock + threadIdx.x;
  Splat splat;
  Counts own = {0, 0};
  bool degenerate = false;
  if (i < p.count) {
    const Fate fate = ProjectOne<kDegree>(p, i, splat);
    degenerate = fate == Fate::kDegenerate;
    if (fate == Fate::kVisible) {
      ForEachTileRun(splat, p.grid, [&](const TileRun& run) { own.entries += run.count; });
    }
    own.visible = own.entries > 0;
  }
  const int num_degenerate = __syncthreads_count(degenerate);
  if (threadIdx.x == 0 && num_degenerate > 0) {
    atomicAdd(reinterpret_cast<unsigned long long*>(p.counters + kNumCulledDegenerate),
              static_cast<unsigned long long>(num_degenerate));
  }
  const int warp = static_cast<int>(threadIdx.x) / 32;
  const uint32_t largest =
      __reduce_max_sync(0xffffffffu, own.visible != 0 ? __float_as_uint(splat.depth) : 0u);
  Counts total;
  const Counts in_warp = WarpExclusiveSum(own, total);
  if (threadIdx.x % 32 == 0) {
    sums.warp[warp] = total;
    atomicMax(&sums.largest_depth, largest);
  }
  __syncthreads();
  SumOverBlocks(p, sums);
  __syncthreads();
  uint64_t visible = sums.visible_before + in_warp.visible;
  uint64_t slot = sums.entries_before + in_warp.entries;
  for (int w = 0; w < warp; ++w) {
    visible += sums.warp[w].visible;
    slot += sums.warp[w].entries;
  }
  if (i == p.count - 1) {
    p.visible_first_slot[visible + own.visible] = ToSlot(slot + own.entries);
  }
  if (threadIdx.x == 0 && sums.largest_depth > 0) {
    atomicMax(reinterpret_cast<unsigned long long*>(p.counters + kLargestDepth),
              static_cast<unsigned long long>(sums.largest_depth));
  }
  if (i >= p.count) return;
  const bool kept = own.visible != 0;
  p.gaussian_visible[i] = kept ? static_cast<int32_t>(visible) : -1;
  if (!kept) return;
  p.visible_gaussian[visible] = static_cast<int32_t>(i);
  float4* words = reinterpret_cast<float4*>(p.visible_splat + visible);
  words[0] = {splat.x, splat.y, splat.root_xx, splat.root_xy};
  words[1] = {splat.root_yy, splat.opacity, splat.r, splat.g};
  words[2] = {splat.b, splat.depth, splat.min_power, splat.half_height};
  p.visible_first_slot[visible] = ToSlot(slot);
}

void LaunchProject(const ProjectParams& p, int num_blocks, cudaStream_t stream) {
  switch (p.sh_degree) {
    case 0:
      return ProjectKernel<0><<<num_blocks, kBlock, 0, stream>>>(p);
    case 1:
      return ProjectKernel<1><<<num_blocks, kBlock, 0, stream>>>(p);
    case 2:
      return ProjectKernel<2><<<num_blocks, kBlock, 0, stream>>>(p);
    default:
      return ProjectKernel<3><<<num_blocks, kBlock, 0, stream>>>(p);
  }
}

}  // namespace

void CudaBackend::ProjectGaussians(const RenderArgs& args) {
  RenderScratch& scratch = *args.scratch;
  const int64_t count = args.gaussians.count;
  scratch.cuda.gaussian_visible.Reserve(*this, count);
  scratch.visible_gaussian.Reserve(*this, count);
  scratch.visible_splat.Reserve(*this, count);
  scratch.visible_first_slot.Reserve(*this, count + 1);
  const int num_blocks = static_cast<int>((count + kBlock - 1) / kBlock);
  const size_t progress_bytes = (1 + 2 * size_t{static_cast<unsigned>(num_blocks)}) * 8;
  auto* progress = static_cast<uint64_t*>(Temporary(progress_bytes));
  if (!error_.empty()) return;
  // All counters but kNumOverflowedRenders, which counts overflowed renders since the scratch was
  // made.
  Zero(scratch.counters.span().data, kNumOverflowedRenders * sizeof(int64_t));
  Zero(scratch.counters.span().data + kLargestDepth, sizeof(int64_t));
  Zero(progress, progress_bytes);
  if (num_blocks == 0) {
    scratch.visible_first_slot.Zero();
    return;
  }
  LaunchProject({ToDevice(args.gaussians),
                 count,
                 MakeProjectionCamera<float>(args.view),
                 {scratch.num_tiles_x, scratch.num_tiles_y},
                 static_cast<float>(args.view.width),
                 static_cast<float>(args.view.height),
                 args.near_plane,
                 args.active_sh_degree,
                 args.dropout,
                 scratch.cuda.gaussian_visible.span().data,
                 scratch.visible_gaussian.span().data,
                 scratch.visible_splat.span().data,
                 scratch.visible_first_slot.span().data,
                 scratch.counters.span().data,
                 progress},
                num_blocks, stream_);
  Launched("project");
}

}  // namespace pepeseg
