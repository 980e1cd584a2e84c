#pragma once

#include "kernels/cuda/device_planes.cuh"
#include "kernels/math/blend.h"
#include "kernels/math/tile_cover.h"

// How a tile of 16x16 pixels is blended: as eight cells of 8x4 pixels, each by one warp with one
// pixel a lane, so that the warp skips as a whole the splats that do not reach its cell. Cells are
// two abreast and numbered row by row. Shared by render.cu, render_backward.cu, render_features.cu
// and rows.cu, which compute alpha with SplatAlpha or its formulas so that they make the
// same decisions. The backward pass rounds offsets differently (cell offset added last), so a power
// within rounding of the threshold may be decided differently there.

namespace pepeseg {

inline constexpr unsigned kAllLanes = 0xffffffffu;
inline constexpr int kTilePixels = kTileSize * kTileSize;
inline constexpr int kCellWidth = 8, kCellHeight = 4;
inline constexpr int kNumCells = kTilePixels / 32;
static_assert(kNumCells == 8 && kTileSize == 2 * kCellWidth && kTileSize == 4 * kCellHeight);

// The entries of a tile are cut into buckets. The forward pass stores the state of each pixel at
// the end of each bucket, so that the backward pass can work on all buckets at once, a warp a
// bucket.
inline constexpr int kBucketSize = 128;
static_assert(kBucketSize % 32 == 0);
// Floats that the backward pass keeps for an entry, see CudaScratch::slot_sums. The last one is not
// used; an even number lets two be read at once.
inline constexpr int kSlotSize = 12;
__host__ __device__ inline int32_t NumBuckets(int32_t num_entries) {
  return (num_entries + kBucketSize - 1) / kBucketSize;
}
// Upper bound of the number of buckets of all tiles: each tile may have one that is not full.
inline int64_t MaxBuckets(int64_t num_entries, int64_t num_tiles) {
  return num_entries / kBucketSize + num_tiles;
}

// Offset of a cell's first pixel from that of its tile.
__device__ inline int CellX(int cell) { return cell % 2 * kCellWidth; }
__device__ inline int CellY(int cell) { return cell / 2 * kCellHeight; }

// Whether a splat reaches scanlines, or pixel centres, of a cell. (x, y) is the offset of the
// cell's first pixel centre from the splat's mean. It depends on the extent alone and may hold
// where no pixel passes the test of the power, never the reverse.
__device__ inline bool ReachesRows(const SplatExtent& extent, float y) {
  return y <= extent.half_height && y + (kCellHeight - 1) >= -extent.half_height;
}
__device__ inline bool ReachesCell(const SplatExtent& extent, float x, float y) {
  if (!ReachesRows(extent, y)) return false;
  const BandCover cover = CoverOfBand(extent, y, y + (kCellHeight - 1));
  return x <= cover.right && x + (kCellWidth - 1) >= cover.left;
}
// The same for all cells of a tile: bit `cell` is set if the splat reaches that cell. (x, y) is the
// offset of the tile's first pixel centre.
__device__ inline uint32_t ReachedCells(const SplatExtent& extent, float x, float y) {
  uint32_t cells = 0;
#pragma unroll
  for (int row = 0; row < kTileSize / kCellHeight; ++row) {
    const float top = y + row * kCellHeight;
    if (!ReachesRows(extent, top)) continue;
    const BandCover cover = CoverOfBand(extent, top, top + (kCellHeight - 1));
#pragma unroll
    for (int column = 0; column < 2; ++column) {
      const float left = x + column * kCellWidth;
      const bool reached = left <= cover.right && left + (kCellWidth - 1) >= cover.left;
      cells |= static_cast<uint32_t>(reached) << (2 * row + column);
    }
  }
  return cells;
}

// 2^x by the hardware's instruction, the same in all passes, so that they agree at thresholds.
__device__ inline float FastExp2(float x) {
  float y;
  asm("ex2.approx.ftz.f32 %0, %1;" : "=f"(y) : "f"(x));
  return y;
}

// Alpha of a splat at a pixel centre (kernels/math/blend.h), 0 where it is skipped.
__device__ inline float SplatAlpha(const SplatWords& s, float pixel_x, float pixel_y) {
  const PowerRoot<float> root = {s.a.z, s.a.w, s.b.x};
  const float power = Power(root.xx, PowerAtRow(root, pixel_y - s.a.y), pixel_x - s.a.x);
  return power < s.c.z ? 0.0f : Alpha(s.b.y, FastExp2(power));
}

// What the kernels over tiles read of a render.
struct TileView {
  int width, height, num_tiles_x;
  const Splat* splats;
  const int32_t* tile_first_entry;
};
inline TileView TilesOf(const RenderScratch& scratch) {
  return {scratch.width, scratch.height, scratch.num_tiles_x, scratch.visible_splat.span().data,
          scratch.tile_first_entry.span().data};
}

}  // namespace pepeseg
