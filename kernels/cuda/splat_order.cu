#include <cuda_runtime.h>

#include <algorithm>
#include <bit>
#include <cub/block/block_scan.cuh>
#include <cub/device/device_radix_sort.cuh>

#include "kernels/cuda/blend_tile.cuh"
#include "kernels/cuda/cuda_backend.h"
#include "kernels/math/tile_cover.h"

// Second part of Render: lists the (Gaussian, tile) entries, sorts them by tile and then by depth,
// and finds the entries and the buckets of each tile. Four launches, ordered by the stream:
//   ListKernel    one thread per visible splat; splats with at least kManyTiles tiles are listed by
//                 all lanes of its warp, one such splat after the other (ballot and shuffles)
//   radix sort    of (key, slot) pairs by cub; stable
//   RangeKernel   one thread per entry: its splat, and the tiles that begin at it
//   BucketKernel  one block: a scan over the tiles, and their order by number of buckets
// ListKernel writes the entries of a splat to slots next to each other, from its first_slot on
// (found in project.cu). entry_slot maps sorted entries back to slots, so that gradients are summed
// slot by slot.
//
// A splat's tiles are counted in project.cu and listed here by the same functions, which are not
// inlined (PEPESEG_HD_SAME_BITS): a difference of one tile would write to another splat's slot.
//
// The sort is stable and slots ascend with the index of the Gaussian, so the order of entries is
// the same in every run. Only tile_order depends on timing, by its atomics; it decides when a tile
// is blended and changes no result.
//
// After an overflowed render nothing is listed, and all tiles are empty.

namespace pepeseg {
namespace {

constexpr int kBlock = 256;
constexpr int kManyTiles = 32;  // from this number of tiles on a whole warp lists those of a splat

struct ListParams {
  Room room;
  TileGrid grid;
  SortKeyBits bits;
  const int32_t* first_slot;
  Splat* splats;
  bool inverse_depth;  // keys are of z; when listed, the depth of a splat becomes 1 / z
  uint64_t* sort_keys;
  int32_t* unsorted_slot;
  int32_t* slot_visible;
};

// Writes the key and the value of one entry.
__device__ void ListEntry(const ListParams& p, int32_t slot, int32_t tile, const Splat& splat,
                          int32_t visible) {
  const uint32_t depth = __float_as_uint(splat.depth) - p.bits.nearest;
  p.sort_keys[slot] = uint64_t{static_cast<uint32_t>(tile)} << p.bits.depth | depth;
  p.unsorted_slot[slot] = slot;
  p.slot_visible[slot] = visible;
}

// Lists the tiles of each visible splat. Those with many tiles are left to the whole warp, with
// each row of tiles spread over the lanes.
__global__ void __launch_bounds__(kBlock) ListKernel(ListParams p) {
  if (p.room.IsVoid()) return;
  const int32_t visible = static_cast<int32_t>(blockIdx.x) * kBlock + threadIdx.x;
  const int lane = static_cast<int>(threadIdx.x) & 31;
  const bool active = visible < p.room.counters[kNumVisible];
  const int32_t first = active ? p.first_slot[visible] : 0;
  const int32_t num_tiles = active ? p.first_slot[visible + 1] - first : 0;
  if (num_tiles > 0 && num_tiles < kManyTiles) {
    int32_t next = first;
    const Splat splat = ToSplat(LoadSplat(p.splats, visible));
    ForEachTileRun(splat, p.grid, [&](const TileRun& run) {
      for (int k = 0; k < run.count; ++k) {
        ListEntry(p, next + k, run.first_tile + k, splat, visible);
      }
      next += run.count;
    });
  }
  uint32_t many = __ballot_sync(kAllLanes, num_tiles >= kManyTiles);
  for (; many != 0; many &= many - 1) {
    const int source = __ffs(many) - 1;
    const int32_t its_visible = __shfl_sync(kAllLanes, visible, source);
    int32_t next = __shfl_sync(kAllLanes, first, source);
    const Splat splat = ToSplat(LoadSplat(p.splats, its_visible));
    ForEachTileRun(splat, p.grid, [&](const TileRun& run) {
      for (int k = lane; k < run.count; k += 32) {
        ListEntry(p, next + k, run.first_tile + k, splat, its_visible);
      }
      next += run.count;
    });
  }
  __syncwarp();  // all lanes have read the splats that they list together
  if (p.inverse_depth && active) {
    p.splats[visible].depth = InverseDepth(p.splats[visible].depth);
  }
}

// Finds tile_first_entry and entry_visible from the sorted keys and slots. An overflowed render has
// no entries. One thread more than there are entries ends the last tiles.
struct RangeParams {
  Room room;
  int num_tiles;
  int depth_bits;
  const uint64_t* sort_keys;
  const int32_t* entry_slot;
  const int32_t* slot_visible;
  int32_t* tile_first_entry;
  int32_t* entry_visible;
};
__global__ void __launch_bounds__(kBlock) RangeKernel(RangeParams p) {
  const int64_t i = int64_t{blockIdx.x} * kBlock + threadIdx.x;
  const int64_t num_entries = p.room.IsVoid() ? 0 : p.room.counters[kNumTileEntries];
  if (i > num_entries) return;
  if (i < num_entries) p.entry_visible[i] = p.slot_visible[p.entry_slot[i]];
  // Tiles that begin at entry i: those after the tile of entry i - 1, up to its own, empty tiles
  // included.
  const int first = i == 0 ? 0 : static_cast<int>(p.sort_keys[i - 1] >> p.depth_bits) + 1;
  const int end = i == num_entries ? p.num_tiles : static_cast<int>(p.sort_keys[i] >> p.depth_bits);
  for (int tile = first; tile <= end; ++tile) p.tile_first_entry[tile] = static_cast<int32_t>(i);
}

// Finds tile_first_bucket, the running sum of the tiles' buckets, and tile_order, in which the
// tiles with the most buckets come first, so that no long tile starts when the others are done. One
// block; next_of_load in shared memory is a histogram of the tiles by load, then the next place of
// each load.
constexpr int kScanBlock = 1024;
constexpr int kNumLoads = 64;  // classes; tiles with 63 buckets or more share the first
// Class of a tile: 0 has the most buckets.
__device__ int LoadOf(int32_t num_buckets) {
  return kNumLoads - 1 - min(num_buckets, kNumLoads - 1);
}

__global__ void __launch_bounds__(kScanBlock)
    BucketKernel(const int32_t* tile_first_entry, int num_tiles, int32_t* tile_first_bucket,
                 int32_t* tile_order) {
  using Scan = cub::BlockScan<int32_t, kScanBlock>;
  __shared__ typename Scan::TempStorage storage;
  __shared__ int32_t next_of_load[kNumLoads];
  if (threadIdx.x < kNumLoads) next_of_load[threadIdx.x] = 0;
  __syncthreads();
  int32_t before = 0;
  for (int base = 0; base < num_tiles; base += kScanBlock) {
    const int tile = base + static_cast<int>(threadIdx.x);
    int32_t own = 0;
    if (tile < num_tiles) {
      own = NumBuckets(tile_first_entry[tile + 1] - tile_first_entry[tile]);
      atomicAdd(&next_of_load[LoadOf(own)], 1);
    }
    int32_t first, total;
    Scan(storage).ExclusiveSum(own, first, total);
    if (tile < num_tiles) tile_first_bucket[tile] = before + first;
    before += total;
    __syncthreads();
  }
  if (threadIdx.x == 0) {
    tile_first_bucket[num_tiles] = before;
    int32_t next = 0;
    for (int32_t& load : next_of_load) {
      const int32_t count = load;
      load = next;
      next += count;
    }
  }
  __syncthreads();
  for (int tile = static_cast<int>(threadIdx.x); tile < num_tiles; tile += kScanBlock) {
    const int32_t own = NumBuckets(tile_first_entry[tile + 1] - tile_first_entry[tile]);
    tile_order[atomicAdd(&next_of_load[LoadOf(own)], 1)] = tile;
  }
}

}  // namespace

// Sorts by tile, then by depth, in one stable sort: equal depths stay in the order of their index.
// Compared with sorting the visible by depth and then the entries by tile, this takes a few more
// passes over the entries. But it lists entries in the order of the visible, where the memory
// accesses of neighbours coalesce, and needs no running sum over sorted splats.
void CudaBackend::ListTileEntries(const RenderArgs& args, const SortKeyBits& bits) {
  RenderScratch& scratch = *args.scratch;
  // With a tile-entry capacity these are upper bounds; the numbers are in the counters.
  const int num_visible = static_cast<int>(scratch.visible_splat.size());
  const int num_entries = static_cast<int>(scratch.entry_visible.size());
  const int num_tiles = scratch.num_tiles_x * scratch.num_tiles_y;
  uint64_t* sort_keys = scratch.cuda.sort_keys.span().data;
  cub::DoubleBuffer<uint64_t> keys(sort_keys, sort_keys + num_entries);
  cub::DoubleBuffer<int32_t> slots(scratch.cuda.unsorted_slot.span().data,
                                   scratch.entry_slot.span().data);
  const int num_bits =
      bits.depth + std::bit_width(static_cast<unsigned>(std::max(num_tiles - 1, 1)));
  const Room room = RoomOf(scratch);
  size_t bytes = 0;
  cub::DeviceRadixSort::SortPairs(nullptr, bytes, keys, slots, num_entries, 0, num_bits, stream_);
  void* temporary = Temporary(bytes);
  if (!error_.empty()) return;
  if (num_visible > 0 && num_entries > 0) {
    // The sort covers the capacity. Keys beyond the entries are all ones, above any tile and depth.
    if (args.tile_entry_capacity > 0) {
      Keep(cudaMemsetAsync(sort_keys, 0xff, num_entries * sizeof(uint64_t), stream_),
           "filling the sort keys");
    }
    ListKernel<<<NumBlocks(num_visible, kBlock), kBlock, 0, stream_>>>(
        {room,
         {scratch.num_tiles_x, scratch.num_tiles_y},
         bits,
         scratch.visible_first_slot.span().data,
         scratch.visible_splat.span().data,
         scratch.inverse_depth,
         sort_keys,
         scratch.cuda.unsorted_slot.span().data,
         scratch.cuda.slot_visible.span().data});
    Launched("list entries");
    Keep(cub::DeviceRadixSort::SortPairs(temporary, bytes, keys, slots, num_entries, 0, num_bits,
                                         stream_),
         "sorting the entries");
    // The sort ends in either of its two buffers, depending on the number of its passes.
    if (slots.Current() != scratch.entry_slot.span().data) {
      std::swap(scratch.entry_slot, scratch.cuda.unsorted_slot);
    }
    Launched("sort entries");
  }
  RangeKernel<<<NumBlocks(int64_t{num_entries} + 1, kBlock), kBlock, 0, stream_>>>(
      {room, num_tiles, bits.depth, keys.Current(), scratch.entry_slot.span().data,
       scratch.cuda.slot_visible.span().data, scratch.tile_first_entry.span().data,
       scratch.entry_visible.span().data});
  Launched("tile ranges");
  BucketKernel<<<1, kScanBlock, 0, stream_>>>(scratch.tile_first_entry.span().data, num_tiles,
                                              scratch.cuda.tile_first_bucket.span().data,
                                              scratch.cuda.tile_order.span().data);
  Launched("tile buckets");
}

}  // namespace pepeseg
