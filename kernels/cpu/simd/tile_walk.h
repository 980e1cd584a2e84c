#pragma once

#include "kernels/cpu/simd/lanes.h"
#include "kernels/cpu/simd_kernels.h"
#include "kernels/math/blend.h"
#include "kernels/math/tile_cover.h"

// The walk over the entries of a tile that all forward blending shares, and the steps of it that
// the backward pass uses, too. An entry is blended only in the blocks of 4x4 pixels that its
// ellipse reaches (ReachedBlocks) and that have pixels in play. The power of a splat is tested
// before the exponential.

namespace pepeseg {
namespace HWY_NAMESPACE {

inline constexpr int kBlockVectors = kBlockPixels / kLanes;
inline constexpr int kBlocksPerRow = kTileSize / kBlockSize;

// The splats of a tile are scattered in memory, so each is prefetched some entries ahead. A splat
// may span two cache lines.
inline constexpr int32_t kPrefetchAhead = 6;
PEPESEG_HD void PrefetchSplat(const TileSplats& tile, int32_t k) {
  if (k < 0 || k >= tile.count) return;
  const char* splat = reinterpret_cast<const char*>(tile.splats + tile.entries[k]);
  __builtin_prefetch(splat);
  __builtin_prefetch(splat + sizeof(Splat) - 1);
}

// Returns the lanes' numbers modulo and divided by kBlockSize.
PEPESEG_HD Lanes LaneColumns() {
  float columns[kLanes];
  for (int i = 0; i < kLanes; ++i) columns[i] = static_cast<float>(i % kBlockSize);
  return Lanes::Load(columns);
}
PEPESEG_HD Lanes LaneRows() {
  float rows[kLanes];
  for (int i = 0; i < kLanes; ++i) rows[i] = static_cast<float>(i / kBlockSize);
  return Lanes::Load(rows);
}

// A row of a block: four pixels.
using BlockRowTag = hn::CappedTag<float, kBlockSize>;
// Loads the first `count` pixels of a row of a block; those beyond are 0.
PEPESEG_HD hn::Vec<BlockRowTag> LoadBlockRow(const float* p, int count) {
  if (HWY_LIKELY(count >= kBlockSize)) return hn::LoadU(BlockRowTag(), p);
  float values[kBlockSize] = {};
  for (int i = 0; i < count; ++i) values[i] = p[i];
  return hn::LoadU(BlockRowTag(), values);
}
PEPESEG_HD hn::Vec<BlockRowTag> LoadBlockRow(const int32_t* p, int count) {
  const hn::RebindToSigned<BlockRowTag> d;
  if (HWY_LIKELY(count >= kBlockSize)) return hn::ConvertTo(BlockRowTag(), hn::LoadU(d, p));
  int32_t values[kBlockSize] = {};
  for (int i = 0; i < count; ++i) values[i] = p[i];
  return hn::ConvertTo(BlockRowTag(), hn::LoadU(d, values));
}
// Stores the first `count` pixels of a row of a block.
PEPESEG_HD void StoreBlockRow(hn::Vec<BlockRowTag> row, float* p, int count) {
  if (HWY_LIKELY(count >= kBlockSize)) return hn::StoreU(row, BlockRowTag(), p);
  float values[kBlockSize];
  hn::StoreU(row, BlockRowTag(), values);
  for (int i = 0; i < count; ++i) p[i] = values[i];
}

// Image coordinates of the pixel centres of a tile.
struct TileCenters {
  Lanes x[kBlocksPerRow];                  // by column of blocks
  Lanes y[kBlocksPerRow * kBlockVectors];  // by row of blocks and vector of a block
};
PEPESEG_HD TileCenters CentersOf(const TileSplats& tile) {
  constexpr int kVectorRows = kBlockSize / kBlockVectors;
  TileCenters out;
  for (int i = 0; i < kBlocksPerRow; ++i) {
    out.x[i] = Lanes(tile.x + 0.5f + static_cast<float>(i * kBlockSize)) + LaneColumns();
  }
  for (int i = 0; i < kBlocksPerRow * kBlockVectors; ++i) {
    out.y[i] = Lanes(tile.y + 0.5f + static_cast<float>(i * kVectorRows)) + LaneRows();
  }
  return out;
}

// A splat prepared for the loop over the blocks of a tile.
struct WalkedSplat {
  PowerRoot<Lanes> root;
  Lanes x, y, min_power, opacity;
};
PEPESEG_HD WalkedSplat PrepareSplat(const Splat& s) {
  return {{Lanes(s.root_xx), Lanes(s.root_xy), Lanes(s.root_yy)},
          Lanes(s.x),
          Lanes(s.y),
          Lanes(s.min_power),
          Lanes(s.opacity)};
}

// Offsets of the pixels of one vector of a block from the mean of a splat.
struct Offsets {
  Lanes dx, dy;
};
PEPESEG_HD Offsets OffsetsOf(const WalkedSplat& s, const TileCenters& centers, int block,
                             int vector) {
  return {centers.x[block % kBlocksPerRow] - s.x,
          centers.y[block / kBlocksPerRow * kBlockVectors + vector] - s.y};
}
PEPESEG_HD Lanes PowerOf(const WalkedSplat& s, const Offsets& at) {
  return Power(s.root.xx, PowerAtRow(s.root, at.dy), at.dx);
}

// The blocks that the ellipse of a splat reaches. A row of blocks is a band of scanlines, and the
// part of an ellipse within a band is convex: the block is reached if its left and its right edge
// are on the right side of the rightmost and leftmost point of that part (CoverOfBand of
// math/tile_cover.h, with all lengths times root_xx, so that nothing is divided). Vectors of four
// have one lane for each row of blocks.
class BlockReach {
 public:
  PEPESEG_HD explicit BlockReach(const TileSplats& tile) {
    const Rows rows;
    const float size = kBlockSize;
    top_ = hn::MulAdd(hn::Iota(rows, 0.0f), hn::Set(rows, size),
                      hn::Set(rows, tile.y + 0.5f - kSlack));
    left_ = MulAdd(LaneColumns(), Lanes(size), Lanes(tile.x + 0.5f - kSlack));
  }

  // Returns a bit for each block. A bit may be set for a block that is missed by less than
  // kSlack, and is never 0 for one with a pixel whose power is at least min_power.
  PEPESEG_HD uint32_t Of(const Splat& s) const {
    const Rows rows;
    const auto height = hn::Set(rows, s.half_height), zero = hn::Zero(rows);
    const auto top = hn::Sub(top_, hn::Set(rows, s.y));
    const auto first = hn::Max(top, hn::Neg(height));
    const auto last = hn::Min(hn::Add(top, hn::Set(rows, kSpan)), height);
    // The y of the rightmost point of the ellipse; the leftmost is opposite.
    const auto norm2 = hn::Set(rows, s.root_xy * s.root_xy + s.root_yy * s.root_yy);
    const auto rightmost =
        hn::Mul(hn::Set(rows, -s.half_height * s.root_xy), hn::ApproximateReciprocalSqrt(norm2));
    const auto right_dy = hn::Min(hn::Max(rightmost, first), last);
    const auto left_dy = hn::Min(hn::Max(hn::Neg(rightmost), first), last);
    const auto root_xy = hn::Set(rows, s.root_xy), root_yy = hn::Set(rows, s.root_yy);
    const auto reach2 = hn::Set(rows, -kExtentSlack * s.min_power);
    const auto right_v = hn::Mul(root_yy, right_dy), left_v = hn::Mul(root_yy, left_dy);
    const auto right_u = hn::Sqrt(hn::Max(zero, hn::NegMulAdd(right_v, right_v, reach2)));
    const auto left_u = hn::Sqrt(hn::Max(zero, hn::NegMulAdd(left_v, left_v, reach2)));
    // A row of blocks that the ellipse misses is to the left of everything.
    const auto right = hn::IfThenElse(
        hn::Le(first, last), hn::NegMulAdd(root_xy, right_dy, right_u), hn::Set(rows, -INFINITY));
    const auto left = hn::MulAdd(root_xy, left_dy, left_u);
    const Lanes root_xx(s.root_xx);
    const Lanes block_left = root_xx * (left_ - Lanes(s.x));
    const Lanes block_right = MulAdd(root_xx, Lanes(kSpan), block_left);
    uint32_t blocks = 0;
    for (int i = 0; i < kTileBlocks / kLanes; ++i) {
      const LaneMask reached =
          (block_left <= SpreadRows(right, i)) & (Lanes(0.0f) <= block_right + SpreadRows(left, i));
      blocks |= BitsOf(reached) << (i * kLanes);
    }
    return blocks;
  }

 private:
  using Rows = BlockRowTag;  // as many rows in a tile as pixels in a row of a block
  // Pixels by which a block is enlarged on all sides, so that rounding loses no pixel.
  static constexpr float kSlack = 1.0f / 64;
  static constexpr float kSpan = kBlockSize - 1 + 2 * kSlack;

  // Lane k gets the value of the row of blocks that block `first_vector` * kLanes + k is in.
  static PEPESEG_HD Lanes SpreadRows(hn::Vec<Rows> rows, int first_vector) {
    const FloatTag d;
    int32_t row[kLanes];
    for (int i = 0; i < kLanes; ++i) row[i] = (first_vector * kLanes + i) / kBlocksPerRow;
    alignas(16) float values[kBlocksPerRow];
    hn::Store(rows, Rows(), values);
    return Lanes(hn::TableLookupLanes(hn::LoadDup128(d, values), hn::SetTableIndices(d, row)));
  }

  hn::Vec<Rows> top_;  // the first scanline of each row of blocks
  Lanes left_;         // the first column of the blocks of a vector
};

// Returns whether any pixel of a block is in play, with a transmittance above 0.
PEPESEG_HD bool AnyLivePixel(const float* transmittance, int block) {
  Lanes most(0.0f);
  for (int i = 0; i < kBlockPixels; i += kLanes) {
    most = Max(most, Lanes::Load(transmittance + block * kBlockPixels + i));
  }
  return !None(Lanes(0.0f) < most);
}
PEPESEG_HD uint32_t LiveBlocks(const float* transmittance) {
  uint32_t live = 0;
  for (int block = 0; block < kTileBlocks; ++block) {
    live |= static_cast<uint32_t>(AnyLivePixel(transmittance, block)) << block;
  }
  return live;
}

// Blends one entry at the vector of pixels that starts at `pixel`. Sets the bit of the block in
// `blended` if a pixel has blended it, and in `stopped` if a pixel has stopped before it.
template <class Visit>
PEPESEG_HD void BlendVector(const WalkedSplat& s, const Offsets& at, float* transmittance,
                            int pixel, uint32_t& blended, uint32_t& stopped, Visit&& visit) {
  const uint32_t block_bit = 1u << (pixel / kBlockPixels);
  const Lanes power = PowerOf(s, at);
  Lanes before = Lanes::Load(transmittance + pixel);
  LaneMask live = (s.min_power <= power) & (Lanes(0.0f) < before);
  if (None(live)) return;
  const Blended<Lanes> step = BlendStep(Alpha(s.opacity, Exp2(power)), before);
  const LaneMask stops = live & (step.transmittance < Lanes(kMinTransmittance));
  if (HWY_UNLIKELY(!None(stops))) {
    stopped |= block_bit;
    live = AndNot(stops, live);
    before = Select(stops, Lanes(0.0f) - before, before);
  }
  blended |= block_bit;
  Select(live, step.transmittance, before).Store(transmittance + pixel);
  visit(pixel, live, Select(live, step.weight, Lanes(0.0f)));
}

// Number of entries whose blocks are found together, ahead of their use: each takes a long chain of
// operations, and the chains of several entries overlap.
inline constexpr int32_t kReachBatch = 16;

// Blends front to back until all pixels have stopped. Calls visit(k, pixel, live, weight) for
// vectors of pixels that entry k hits, where `pixel` is the index of the first of them in the tile
// and weight = alpha_k T_k, 0 where not live. Then calls done(k, blended, stopped) with a bit for
// each block in which the entry was blended, and for each in which pixels stopped before it.
//
// `transmittance`, [kTilePixels], is in and out. A value of 0 or less marks a pixel out of play: a
// pixel that has stopped keeps its transmittance with a negative sign. Returns the number of
// entries that any pixel has seen.
template <class Visit, class Done>
PEPESEG_HD void WalkTile(const TileSplats& tile, float* transmittance, Visit&& visit, Done&& done) {
  const BlockReach reach(tile);
  const TileCenters centers = CentersOf(tile);
  uint32_t live_blocks = LiveBlocks(transmittance);
  uint32_t reached[kReachBatch];
  for (int32_t k = 0; k < tile.count && live_blocks != 0; ++k) {
    if (k % kReachBatch == 0) {
      for (int32_t i = 0; i < Min(kReachBatch, tile.count - k); ++i) {
        PrefetchSplat(tile, k + i + kPrefetchAhead);
        reached[i] = reach.Of(tile.splats[tile.entries[k + i]]);
      }
    }
    const WalkedSplat s = PrepareSplat(tile.splats[tile.entries[k]]);
    uint32_t blended = 0, stopped = 0;
    for (uint32_t bits = reached[k % kReachBatch] & live_blocks; bits != 0; bits &= bits - 1) {
      const int block = __builtin_ctz(bits);
      for (int i = 0; i < kBlockVectors; ++i) {
        BlendVector(
            s, OffsetsOf(s, centers, block, i), transmittance, block * kBlockPixels + i * kLanes,
            blended,
            stopped, [&](int pixel, LaneMask live, Lanes weight) __attribute__((always_inline)) {
              visit(k, pixel, live, weight);
            });
      }
    }
    done(k, blended, stopped);
    for (; HWY_UNLIKELY(stopped != 0); stopped &= stopped - 1) {
      const int block = __builtin_ctz(stopped);
      live_blocks &= ~(static_cast<uint32_t>(!AnyLivePixel(transmittance, block)) << block);
    }
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace pepeseg
