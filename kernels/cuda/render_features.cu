#include <cuda_fp16.h>
#include <cuda_runtime.h>

#include "kernels/cuda/blend_tile.cuh"
#include "kernels/cuda/cuda_backend.h"

// RenderFeatures (RenderFeaturesArgs in kernels/ops/render.h; METHOD.md section 4): the feature of
// each pixel, blended with the weights of colour, as halves.
//
// One warp per cell of 8x4 pixels of a tile (blend_tile.cuh), one lane per pixel with its 32 sums
// in registers; a block is two warps, which do not wait for each other. The warp takes the entries
// of the tile in groups of 32: lane k loads splat k into shared memory and tests it against the
// cell, the whole warp loads the features of those that reach the cell, 32 floats at a time, and
// then each lane blends them in order. __syncwarp separates writing the group (FeatureBatch) from
// reading it.
//
// Each pixel is summed by one thread in the order of the entries, with the decisions of Render
// (SplatAlpha, pixel_last_entry): maps are the same in every run.

namespace pepeseg {
namespace {

struct FeatureParams {
  TileView tiles;
  const int32_t* entry_visible;
  const int32_t* visible_gaussian;
  const int32_t* pixel_last_entry;
  const float* features;    // [N, 32]
  const float* confidence;  // [N] or null
  __half* map;              // [H * W, 32]
};

// Shared memory of a warp: 32 splats as SplatWords, with the features of those that reach the cell.
struct FeatureBatch {
  float4 a[32], b[32], c[32];
  float confidence[32];
  float4 feature[32][kFeatureSize / 4];
};

// Warp `index` of the launch has cell index % 8 of tile index / 8.
__global__ void __launch_bounds__(64) FeatureKernel(FeatureParams p) {
  __shared__ FeatureBatch batches[2];
  FeatureBatch& batch = batches[threadIdx.x / 32];
  const int lane = static_cast<int>(threadIdx.x) % 32;
  const int index = static_cast<int>(blockIdx.x) * 2 + static_cast<int>(threadIdx.x) / 32;
  const int tile = index / kNumCells, cell = index % kNumCells;
  const int cell_x = tile % p.tiles.num_tiles_x * kTileSize + CellX(cell);
  const int cell_y = tile / p.tiles.num_tiles_x * kTileSize + CellY(cell);
  const int x = cell_x + lane % kCellWidth, y = cell_y + lane / kCellWidth;
  const bool inside = x < p.tiles.width && y < p.tiles.height;
  const int64_t pixel = int64_t{y} * p.tiles.width + x;
  const int32_t first = p.tiles.tile_first_entry[tile];
  const int32_t end = first + (inside ? p.pixel_last_entry[pixel] : 0);
  const int32_t last_end = __reduce_max_sync(kAllLanes, end);
  float transmittance = 1, weights = 0, confident = 0, sum[kFeatureSize] = {};
  for (int32_t base = first; base < last_end; base += 32) {
    bool reached = false;
    int32_t gaussian = 0;
    __syncwarp();
    if (base + lane < last_end) {
      const int32_t visible = p.entry_visible[base + lane];
      const SplatWords s = LoadSplat(p.tiles.splats, visible);
      batch.a[lane] = s.a;
      batch.b[lane] = s.b;
      batch.c[lane] = s.c;
      gaussian = p.visible_gaussian[visible];
      batch.confidence[lane] = p.confidence == nullptr ? 1.0f : p.confidence[gaussian];
      reached =
          ReachesCell(MakeSplatExtent(ToSplat(s)), cell_x + 0.5f - s.a.x, cell_y + 0.5f - s.a.y);
    }
    const uint32_t all = __ballot_sync(kAllLanes, reached);
    // The 32 floats of one Gaussian at a time, a channel a lane.
    for (uint32_t left = all; left != 0; left &= left - 1) {
      const int k = __ffs(left) - 1;
      const int64_t from = int64_t{__shfl_sync(kAllLanes, gaussian, k)} * kFeatureSize;
      reinterpret_cast<float*>(batch.feature[k])[lane] = p.features[from + lane];
    }
    __syncwarp();
    for (uint32_t left = all; left != 0; left &= left - 1) {
      const int k = __ffs(left) - 1;
      const SplatWords s = {batch.a[k], batch.b[k], batch.c[k]};
      const float alpha = base + k < end ? SplatAlpha(s, x + 0.5f, y + 0.5f) : 0.0f;
      if (alpha == 0) continue;
      const auto [weight, next] = BlendStep(alpha, transmittance);
      const float share = weight * batch.confidence[k];
      transmittance = next;
      weights += weight;
      confident += share;
#pragma unroll
      for (int i = 0; i < kFeatureSize / 4; ++i) {
        const float4 f = batch.feature[k][i];
        sum[4 * i] += share * f.x;
        sum[4 * i + 1] += share * f.y;
        sum[4 * i + 2] += share * f.z;
        sum[4 * i + 3] += share * f.w;
      }
    }
  }
  if (!inside) return;
  const float factor = p.confidence == nullptr || confident == 0 ? 1.0f : weights / confident;
  __half2* out = reinterpret_cast<__half2*>(p.map + pixel * kFeatureSize);
#pragma unroll
  for (int i = 0; i < kFeatureSize / 2; ++i) {
    out[i] = __floats2half2_rn(factor * sum[2 * i], factor * sum[2 * i + 1]);
  }
}

}  // namespace

void CudaBackend::RenderFeatures(const RenderFeaturesArgs& args) {
  const Turn turn(*this);
  if (!turn) return;
  const RenderScratch& scratch = *args.scratch;
  const int num_tiles = scratch.num_tiles_x * scratch.num_tiles_y;
  if (num_tiles == 0) return;
  FeatureKernel<<<num_tiles * kNumCells / 2, 64, 0, stream_>>>(
      {TilesOf(scratch), scratch.entry_visible.span().data, scratch.visible_gaussian.span().data,
       scratch.pixel_last_entry.span().data, args.features.data, args.confidence.data,
       reinterpret_cast<__half*>(args.map.data)});
  Launched("render features");
}

}  // namespace pepeseg
