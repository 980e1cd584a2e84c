#include <cuda_runtime.h>

#include <cub/device/device_scan.cuh>

#include "kernels/cuda/blend_tile.cuh"
#include "kernels/cuda/cuda_backend.h"
#include "kernels/cuda/fit.h"
#include "kernels/cuda/launch.h"

// CaptureRows (CaptureRowsArgs in kernels/ops/render.h; METHOD.md section 3, "Rows"): the Gaussians
// that are blended at sampled pixels, with their weights. RowKernel runs twice, first to count the
// entries of each row, then, after a running sum by cub and a wait of the host that sizes the
// outputs, to store them.
//
// A warp has one pixel, a lane one entry of its tile. A block is four such warps, which share
// nothing. Shuffles make the running product of 1 - alpha over the lanes, which is the
// transmittance before each entry, and the ballot of the lanes that blend gives the place of each
// in the row. Both runs must decide alike, or a row would overrun its place: they execute the same
// code on the same entries.
//
// Every row is written by one warp in the order of the entries, and sums over lanes are a fixed
// tree: rows are the same in every run. Weights may differ from those of Render in the last bits,
// because the products associate differently.

namespace pepeseg {
namespace {

constexpr int kBlock = 128;

struct RowParams {
  TileView tiles;
  const int32_t* entry_visible;
  const int32_t* visible_gaussian;
  const int32_t* pixel_last_entry;
  bool inverse_depth;
  const int32_t* pixels;
  int64_t num_pixels;
  int32_t* row_first;  // [S + 1]; the first run writes the number of entries of row i to place i
  int32_t* entry_gaussian;
  float* entry_weight;
  float *pixel_alpha, *pixel_depth;  // may be null
};

// kStore: the second run, with row_first known.
template <bool kStore>
__global__ void __launch_bounds__(kBlock) RowKernel(RowParams p) {
  const int64_t row = (int64_t{blockIdx.x} * kBlock + threadIdx.x) / 32;
  const int lane = static_cast<int>(threadIdx.x) % 32;
  if (row >= p.num_pixels) return;
  const int32_t pixel = p.pixels[row];
  const int x = pixel % p.tiles.width, y = pixel / p.tiles.width;
  const int32_t first =
      p.tiles.tile_first_entry[y / kTileSize * p.tiles.num_tiles_x + x / kTileSize];
  const int32_t end = first + p.pixel_last_entry[pixel];
  int32_t next = kStore ? p.row_first[row] : 0;
  float transmittance = 1, alpha_sum = 0, depth_sum = 0;
  for (int32_t base = first; base < end; base += 32) {
    float alpha = 0, depth = 0;
    int32_t visible = 0;
    if (base + lane < end) {
      visible = p.entry_visible[base + lane];
      const SplatWords s = LoadSplat(p.tiles.splats, visible);
      alpha = SplatAlpha(s, x + 0.5f, y + 0.5f);
      depth = p.inverse_depth ? InverseDepth(s.c.y) : s.c.y;
    }
    const uint32_t blended = __ballot_sync(kAllLanes, alpha > 0);
    // Transmittance behind the group's splats up to and including this lane's, alone.
    float passed = BlendStep(alpha, 1.0f).transmittance;
    for (int offset = 1; offset < 32; offset *= 2) {
      const float other = __shfl_up_sync(kAllLanes, passed, offset);
      if (lane >= offset) passed *= other;
    }
    float before = __shfl_up_sync(kAllLanes, passed, 1);
    if (lane == 0) before = 1;
    const float weight = BlendStep(alpha, transmittance).weight * before;
    transmittance *= __shfl_sync(kAllLanes, passed, 31);
    if (kStore && alpha > 0) {
      const int32_t at = next + __popc(blended & ((1u << lane) - 1));
      p.entry_gaussian[at] = p.visible_gaussian[visible];
      p.entry_weight[at] = weight;
    }
    next += __popc(blended);
    alpha_sum += weight;
    depth_sum += weight * depth;
  }
  if constexpr (!kStore) {
    if (lane == 0) p.row_first[row] = next;
    return;
  }
  for (int offset = 16; offset > 0; offset /= 2) {
    alpha_sum += __shfl_xor_sync(kAllLanes, alpha_sum, offset);
    depth_sum += __shfl_xor_sync(kAllLanes, depth_sum, offset);
  }
  if (lane != 0) return;
  if (p.pixel_alpha != nullptr) p.pixel_alpha[row] = alpha_sum;
  if (p.pixel_depth != nullptr) p.pixel_depth[row] = depth_sum;
}

}  // namespace

// The host waits once, for the number of entries.
void CudaBackend::CaptureRows(const CaptureRowsArgs& args) {
  const Turn turn(*this);
  if (!turn) return;
  const RenderScratch& scratch = *args.scratch;
  const int64_t num_pixels = args.pixels.size;
  args.row_first->Reserve(*this, num_pixels + 1);
  int32_t* row_first = args.row_first->span().data;
  size_t scan_bytes = 0;
  cub::DeviceScan::ExclusiveSum(nullptr, scan_bytes, row_first, num_pixels + 1, stream_);
  void* temporary = Temporary(scan_bytes);
  if (!error_.empty()) return;
  args.row_first->Zero();
  RowParams params = {TilesOf(scratch),
                      scratch.entry_visible.span().data,
                      scratch.visible_gaussian.span().data,
                      scratch.pixel_last_entry.span().data,
                      scratch.inverse_depth,
                      args.pixels.data,
                      num_pixels,
                      row_first,
                      nullptr,
                      nullptr,
                      args.pixel_alpha.data,
                      args.pixel_depth.data};
  const int num_blocks = NumBlocks(num_pixels * 32, kBlock);
  if (num_blocks > 0) RowKernel<false><<<num_blocks, kBlock, 0, stream_>>>(params);
  Launched("count rows");
  Keep(cub::DeviceScan::ExclusiveSum(temporary, scan_bytes, row_first, num_pixels + 1, stream_),
       "summing the rows");
  Launched("sum rows");
  int32_t num_entries = 0;
  CopyToHost(&num_entries, row_first + num_pixels, sizeof(num_entries));
  if (!error_.empty()) return;
  Fit(*this, num_entries, *args.entry_gaussian);
  Fit(*this, num_entries, *args.entry_weight);
  if (!error_.empty() || num_blocks == 0) return;
  params.entry_gaussian = args.entry_gaussian->span().data;
  params.entry_weight = args.entry_weight->span().data;
  RowKernel<true><<<num_blocks, kBlock, 0, stream_>>>(params);
  Launched("store rows");
}

}  // namespace pepeseg
