#include <cuda_runtime.h>

#include <algorithm>
#include <bit>

#include "kernels/cuda/blend_tile.cuh"
#include "kernels/cuda/cuda_backend.h"

// Render (RenderArgs in kernels/ops/render.h; METHOD.md section 1, "Rendering"): sizes the scratch,
// runs project.cu and splat_order.cu, and blends the tiles front to back (kernels/math/blend.h).
//
// BlendKernel: one block per tile, one warp per cell of 8x4 pixels (blend_tile.cuh), one thread per
// pixel.
// The block goes through the entries of the tile in batches of 256: each thread loads one entry
// into registers while the batch before is blended, and stores it to shared memory between two
// barriers. The first of them, __syncthreads_and, also ends the loop once all pixels are opaque.
// Within a batch the warps do not wait for each other: a lane tests one of 32 splats against the
// warp's cell, the ballot lists those that reach it, and all lanes blend these in order.
//
// Each pixel is blended by one thread in the order of the entries, so images are the same in every
// run. Threads write only their own pixels.
//
// For the backward pass a thread also stores what its pixel has accumulated at the end of each
// bucket of 128 entries that is not the last of its tile, unless its whole warp is opaque by then:
// the backward pass reads only buckets that end before the last entry that the pixel has blended.

namespace pepeseg {
namespace {

struct BlendParams {
  TileView tiles;
  Room room;
  const int32_t* entry_visible;
  const int32_t* tile_first_bucket;
  const int32_t* tile_order;
  // Outputs. alpha and depth may be null, and so may pixel_color, pixel_depth and the bucket_
  // arrays, which are for the backward pass.
  float *color, *alpha, *depth;
  float4* pixel_color;
  float* pixel_depth;
  float* pixel_transmittance;
  int32_t* pixel_last_entry;
  int32_t* bucket_tile;
  float4* bucket_color;
  float* bucket_depth;
  int64_t* num_overflowed_renders;  // counter of overflowed renders
};

// Shared memory of a block: the splats of 256 entries as words (SplatWords), and their extents.
struct Batch {
  float4 a[kTilePixels], b[kTilePixels], c[kTilePixels];
  SplatExtent extent[kTilePixels];
};

// State of a pixel while it is blended.
struct PixelSum {
  float4 color;  // rgb and transmittance
  float depth;   // sum of weight * depth
  int32_t last;  // end of the entries of the tile that it has blended
  bool done;     // opaque, or outside the image
};

// Loads entry `first + threadIdx.x` into registers; zeros beyond `end`.
__device__ SplatWords LoadEntry(const BlendParams& p, int32_t first, int32_t end) {
  const int32_t entry = first + static_cast<int32_t>(threadIdx.x);
  return entry < end ? LoadSplat(p.tiles.splats, p.entry_visible[entry]) : SplatWords{};
}
__device__ void StoreEntry(const SplatWords& s, Batch& batch) {
  batch.a[threadIdx.x] = s.a;
  batch.b[threadIdx.x] = s.b;
  batch.c[threadIdx.x] = s.c;
  batch.extent[threadIdx.x] = MakeSplatExtent(ToSplat(s));
}

// `entry` counts from the first entry of the tile.
template <bool kDepth>
__device__ void BlendSplat(const SplatWords& s, float x, float y, int32_t entry, PixelSum& sum) {
  const float alpha = SplatAlpha(s, x, y);
  if (sum.done || alpha == 0) return;
  const auto [weight, next] = BlendStep(alpha, sum.color.w);
  if (next < kMinTransmittance) {
    sum.done = true;
    return;
  }
  sum.color.x += weight * s.b.z;
  sum.color.y += weight * s.b.w;
  sum.color.z += weight * s.c.x;
  sum.color.w = next;
  if constexpr (kDepth) sum.depth += weight * s.c.y;
  sum.last = entry + 1;
}

template <bool kDepth>
__device__ void StoreBucket(const BlendParams& p, int32_t bucket, const PixelSum& sum) {
  const int64_t at = int64_t{bucket} * kTilePixels + threadIdx.x;
  p.bucket_color[at] = sum.color;
  if constexpr (kDepth) p.bucket_depth[at] = sum.depth;
}

template <bool kDepth>
__device__ void StorePixel(const BlendParams& p, int tile, int x, int y, const PixelSum& sum) {
  const int64_t in_tiles = int64_t{tile} * kTilePixels + threadIdx.x;
  if (p.pixel_color != nullptr) {
    p.pixel_color[in_tiles] = sum.color;
    if constexpr (kDepth) p.pixel_depth[in_tiles] = sum.depth;
  }
  if (x >= p.tiles.width || y >= p.tiles.height) return;
  const int64_t num_pixels = int64_t{p.tiles.width} * p.tiles.height;
  const int64_t pixel = int64_t{y} * p.tiles.width + x;
  p.color[pixel] = sum.color.x;
  p.color[num_pixels + pixel] = sum.color.y;
  p.color[2 * num_pixels + pixel] = sum.color.z;
  if (p.alpha != nullptr) p.alpha[pixel] = 1 - sum.color.w;
  if constexpr (kDepth) p.depth[pixel] = sum.depth;
  p.pixel_transmittance[pixel] = sum.color.w;
  p.pixel_last_entry[pixel] = sum.last;
}

// Blends the tile tile_order[blockIdx.x].
template <bool kDepth>
__global__ void __launch_bounds__(kTilePixels) BlendKernel(BlendParams p) {
  __shared__ Batch batch;
  const int lane = static_cast<int>(threadIdx.x) % 32, cell = static_cast<int>(threadIdx.x) / 32;
  const int tile = p.tile_order[blockIdx.x];
  const int cell_x = tile % p.tiles.num_tiles_x * kTileSize + CellX(cell);
  const int cell_y = tile / p.tiles.num_tiles_x * kTileSize + CellY(cell);
  const int x = cell_x + lane % kCellWidth, y = cell_y + lane / kCellWidth;
  const float center_x = x + 0.5f, center_y = y + 0.5f;
  const int32_t first = p.tiles.tile_first_entry[tile], end = p.tiles.tile_first_entry[tile + 1];
  const int32_t first_bucket = p.tile_first_bucket[tile];
  const int num_buckets = p.bucket_tile == nullptr ? 0 : NumBuckets(end - first);
  for (int k = static_cast<int>(threadIdx.x); k < num_buckets; k += kTilePixels) {
    p.bucket_tile[first_bucket + k] = tile;
  }
  // One thread of the launch counts an overflowed render.
  if (tile == 0 && threadIdx.x == 0 && p.room.IsVoid()) ++*p.num_overflowed_renders;

  PixelSum sum = {{0, 0, 0, 1}, 0, 0, x >= p.tiles.width || y >= p.tiles.height};
  SplatWords loaded = LoadEntry(p, first, end);
  for (int32_t base = first; base < end; base += kTilePixels) {
    if (__syncthreads_and(sum.done)) break;
    StoreEntry(loaded, batch);
    loaded = LoadEntry(p, base + kTilePixels, end);
    __syncthreads();
    for (int group = 0; group < kTilePixels && base + group < end; group += 32) {
      if (__all_sync(kAllLanes, sum.done)) break;
      const int mine = group + lane;
      const bool reached =
          base + mine < end && ReachesCell(batch.extent[mine], cell_x + 0.5f - batch.a[mine].x,
                                           cell_y + 0.5f - batch.a[mine].y);
      for (uint32_t left = __ballot_sync(kAllLanes, reached); left != 0; left &= left - 1) {
        const int k = group + __ffs(left) - 1;
        const SplatWords s = {batch.a[k], batch.b[k], batch.c[k]};
        BlendSplat<kDepth>(s, center_x, center_y, base - first + k, sum);
      }
      const int32_t passed = base + group + 32 - first;
      if (p.bucket_color != nullptr && passed % kBucketSize == 0 && first + passed < end) {
        StoreBucket<kDepth>(p, first_bucket + passed / kBucketSize - 1, sum);
      }
    }
  }
  StorePixel<kDepth>(p, tile, x, y, sum);
}

}  // namespace

// Sizes the buffers that are counted by entries, tiles and buckets, for the tile-entry capacity or,
// without one, for the number of entries, for which the host waits. Returns the layout of the sort
// keys: where the host knows the largest depth, keys have fewer bits and the sort fewer passes.
SortKeyBits CudaBackend::MakeRoom(const RenderArgs& args) {
  RenderScratch& scratch = *args.scratch;
  const int64_t num_tiles = int64_t{scratch.num_tiles_x} * scratch.num_tiles_y;
  const uint32_t nearest = std::bit_cast<uint32_t>(std::max(args.near_plane, 0.0f));
  SortKeyBits bits = {nearest, 31};
  int64_t num_entries = args.tile_entry_capacity;
  if (num_entries == 0) {
    Keep(cudaMemcpyAsync(pinned_counters_, scratch.counters.span().data,
                         kNumCudaCounters * sizeof(int64_t), cudaMemcpyDeviceToHost, stream_),
         "copying the counters");
    Keep(cudaStreamSynchronize(stream_), "waiting for the counters");
    if (!error_.empty()) return bits;
    num_entries = pinned_counters_[kNumTileEntries];
    if (num_entries > INT32_MAX) {
      Fail({"rendering " + std::to_string(scratch.width) + "x" + std::to_string(scratch.height) +
            " pixels takes " + std::to_string(num_entries) +
            " pairs of a Gaussian and a tile; the limit is 2147483647; render fewer pixels"});
      return bits;
    }
    const auto largest = static_cast<uint32_t>(pinned_counters_[kLargestDepth]);
    bits.depth = std::bit_width(std::max(largest, nearest + 1) - nearest);
    const int64_t num_visible = pinned_counters_[kNumVisible];
    scratch.visible_gaussian.Resize(num_visible);
    scratch.visible_splat.Resize(num_visible);
    scratch.visible_first_slot.Resize(num_visible + 1);
  }
  scratch.entry_visible.Reserve(*this, num_entries);
  scratch.entry_slot.Reserve(*this, num_entries);
  scratch.cuda.unsorted_slot.Reserve(*this, num_entries);
  scratch.cuda.slot_visible.Reserve(*this, num_entries);
  scratch.cuda.sort_keys.Reserve(*this, 2 * num_entries);
  scratch.tile_first_entry.Reserve(*this, num_tiles + 1);
  scratch.cuda.tile_first_bucket.Reserve(*this, num_tiles + 1);
  scratch.cuda.tile_order.Reserve(*this, num_tiles);
  if (!args.for_backward) return bits;
  const int64_t num_buckets = MaxBuckets(num_entries, num_tiles);
  scratch.cuda.bucket_tile.Reserve(*this, num_buckets);
  scratch.cuda.bucket_color.Reserve(*this, num_buckets * kTilePixels * 4);
  scratch.cuda.pixel_color.Reserve(*this, num_tiles * kTilePixels * 4);
  if (args.depth.empty()) return bits;
  scratch.cuda.bucket_depth.Reserve(*this, num_buckets * kTilePixels);
  scratch.cuda.pixel_depth.Reserve(*this, num_tiles * kTilePixels);
  return bits;
}

// A launch for each part, ordered by the stream. With a tile-entry capacity the host waits for
// nothing, and the launches can be recorded.
void CudaBackend::Render(const RenderArgs& args) {
  const Turn turn(*this);
  if (!turn) return;
  RenderScratch& scratch = *args.scratch;
  scratch.width = args.view.width;
  scratch.height = args.view.height;
  scratch.num_tiles_x = (args.view.width + kTileSize - 1) / kTileSize;
  scratch.num_tiles_y = (args.view.height + kTileSize - 1) / kTileSize;
  scratch.inverse_depth = args.inverse_depth;
  scratch.for_backward = args.for_backward;
  scratch.counters.Reserve(*this, kNumCudaCounters);
  const int64_t num_pixels = int64_t{scratch.width} * scratch.height;
  scratch.pixel_transmittance.Reserve(*this, num_pixels);
  scratch.pixel_last_entry.Reserve(*this, num_pixels);
  if (!error_.empty()) return;
  ProjectGaussians(args);
  const SortKeyBits bits = MakeRoom(args);
  if (!error_.empty()) return;
  ListTileEntries(args, bits);
  if (!error_.empty()) return;
  BlendParams params = {TilesOf(scratch),
                        RoomOf(scratch),
                        scratch.entry_visible.span().data,
                        scratch.cuda.tile_first_bucket.span().data,
                        scratch.cuda.tile_order.span().data,
                        args.color.data,
                        args.alpha.data,
                        args.depth.data};
  params.pixel_transmittance = scratch.pixel_transmittance.span().data;
  params.pixel_last_entry = scratch.pixel_last_entry.span().data;
  params.num_overflowed_renders = scratch.counters.span().data + kNumOverflowedRenders;
  if (args.for_backward) {
    params.pixel_color = reinterpret_cast<float4*>(scratch.cuda.pixel_color.span().data);
    params.pixel_depth = scratch.cuda.pixel_depth.span().data;
    params.bucket_tile = scratch.cuda.bucket_tile.span().data;
    params.bucket_color = reinterpret_cast<float4*>(scratch.cuda.bucket_color.span().data);
    params.bucket_depth = scratch.cuda.bucket_depth.span().data;
  }
  const int num_tiles = scratch.num_tiles_x * scratch.num_tiles_y;
  if (args.depth.empty()) {
    BlendKernel<false><<<num_tiles, kTilePixels, 0, stream_>>>(params);
  } else {
    BlendKernel<true><<<num_tiles, kTilePixels, 0, stream_>>>(params);
  }
  Launched("blend");
}

}  // namespace pepeseg
