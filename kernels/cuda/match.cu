#include <cuda_runtime.h>

#include <algorithm>
#include <vector>

#include "kernels/cuda/cuda_backend.h"
#include "kernels/cuda/tensor_core.cuh"
#include "kernels/math/match.h"

// MatchDescriptors (kernels/ops/match.h).
//
// NearestKernel: a block owns 128 descriptors of one side of a pair (rows) and compares them with
// all of the other side (columns); gridDim is (blocks of rows, pairs, 2 directions). Both
// directions are computed, which costs less than exchanging the best of columns between blocks. A
// warp owns 32 rows and keeps their bytes in registers for the whole pass. Columns come in tiles of
// 64 through shared memory, two tiles at a time: while the block works on one, the other arrives by
// cp.async. A barrier after each tile separates its readers from the copy that overwrites it. The
// tensor cores add products of bytes to integers (m16n8k32); a thread merges each product into the
// best two of its four rows in registers, and at the end the four threads of a row merge theirs.
//
// MutualKernel: one thread per row of a pair. There are no atomics, and integers add exactly.

namespace pepeseg {
namespace {

constexpr int kWarps = 4;
constexpr int kBlock = 32 * kWarps;
constexpr int kRows = 32 * kWarps;  // of a block
constexpr int kColumns = 64;        // of a tile
// Columns are this far apart in shared memory, so that the eight of an instruction lie in different
// banks.
constexpr int kPitch = kDescriptorBytes + 16;
constexpr int kSteps = kDescriptorBytes / 32;  // instructions along a descriptor

// A pair on the device. The indices of its matches follow each other: [rows of first] and
// [rows of second] from `out` on.
struct DevicePair {
  int64_t first, second;  // first descriptor of each block
  int32_t num_first, num_second;
  int64_t out;
};

struct NearestParams {
  const uint8_t* descriptors;
  const DevicePair* pairs;
  const int32_t* second_limits;
  int32_t* match_of;  // out: the match of each row that passes, or -1
};

// Starts the copy of a tile of columns; those beyond `count` are set to 0.
__device__ void CopyTile(const uint8_t* columns, int32_t count, uint8_t* tile) {
  constexpr int kPieces = kDescriptorBytes / 16;
  for (int i = static_cast<int>(threadIdx.x); i < kColumns * kPieces; i += kBlock) {
    const int column = i / kPieces, piece = i % kPieces;
    const auto to =
        static_cast<uint32_t>(__cvta_generic_to_shared(tile + column * kPitch + piece * 16));
    const bool real = column < count;
    const uint8_t* from = columns + (real ? column * kDescriptorBytes + piece * 16 : 0);
    asm volatile("cp.async.cg.shared.global [%0], [%1], 16, %2;" ::"r"(to), "l"(from),
                 "r"(real ? 16 : 0));
  }
  asm volatile("cp.async.commit_group;");
}

// The bytes of 32 rows of a warp, as the first factor of MultiplyBytes. Rows beyond `count` are 0.
struct RowBytes {
  uint32_t a[2][kSteps][4];
};
__device__ RowBytes LoadRows(const uint8_t* rows, int32_t count, int lane) {
  RowBytes out;
#pragma unroll
  for (int half = 0; half < 2; ++half) {
#pragma unroll
    for (int step = 0; step < kSteps; ++step) {
#pragma unroll
      for (int e = 0; e < 4; ++e) {
        const int row = half * 16 + lane / 4 + e % 2 * 8;
        const int byte = step * 32 + lane % 4 * 4 + e / 2 * 16;
        out.a[half][step][e] =
            row < count
                ? *reinterpret_cast<const uint32_t*>(rows + int64_t{row} * kDescriptorBytes + byte)
                : 0;
      }
    }
  }
  return out;
}

// Multiplies a warp's rows with eight columns and merges the products into `nearest`, which are
// rows lane / 4 + 8 k. Products of padding are 0, which is never the best.
__device__ void OfferColumns(const RowBytes& rows, const uint8_t* columns, int32_t index, int lane,
                             NearestDots (&nearest)[4]) {
  int32_t dots[2][4] = {};
  const uint8_t* own = columns + lane / 4 * kPitch + lane % 4 * 4;
#pragma unroll
  for (int step = 0; step < kSteps; ++step) {
    const uint32_t b[2] = {*reinterpret_cast<const uint32_t*>(own + step * 32),
                           *reinterpret_cast<const uint32_t*>(own + step * 32 + 16)};
    MultiplyBytes(rows.a[0][step], b, dots[0]);
    MultiplyBytes(rows.a[1][step], b, dots[1]);
  }
  const int32_t column = index + lane % 4 * 2;
#pragma unroll
  for (int row = 0; row < 4; ++row) {
#pragma unroll
    for (int k = 0; k < 2; ++k) {
      const int32_t dot = dots[row / 2][row % 2 * 2 + k];
      NearestDots& own_row = nearest[row];
      own_row.second = max(own_row.second, min(own_row.best, dot));
      own_row.index = dot > own_row.best ? column + k : own_row.index;
      own_row.best = max(own_row.best, dot);
    }
  }
}

// The nearest of a row, of which four adjacent lanes hold a part each.
__device__ NearestDots MergeLanes(NearestDots nearest) {
#pragma unroll
  for (int distance = 1; distance < 4; distance *= 2) {
    const NearestDots other = {__shfl_xor_sync(~0u, nearest.best, distance),
                               __shfl_xor_sync(~0u, nearest.second, distance),
                               __shfl_xor_sync(~0u, nearest.index, distance)};
    nearest = Merge(nearest, other);
  }
  return nearest;
}

__global__ void __launch_bounds__(kBlock) NearestKernel(NearestParams p) {
  __shared__ __align__(16) uint8_t tiles[2][kColumns * kPitch];
  const DevicePair pair = p.pairs[blockIdx.y];
  const bool back = blockIdx.z == 1;
  const int32_t num_rows = back ? pair.num_second : pair.num_first;
  const int32_t num_columns = back ? pair.num_first : pair.num_second;
  if (static_cast<int32_t>(blockIdx.x) * kRows >= num_rows) return;
  const uint8_t* rows = p.descriptors + (back ? pair.second : pair.first) * kDescriptorBytes;
  const uint8_t* columns = p.descriptors + (back ? pair.first : pair.second) * kDescriptorBytes;
  const int lane = static_cast<int>(threadIdx.x) % 32;
  const int32_t first_row =
      static_cast<int32_t>(blockIdx.x) * kRows + static_cast<int32_t>(threadIdx.x) / 32 * 32;
  const RowBytes own =
      LoadRows(rows + int64_t{first_row} * kDescriptorBytes, num_rows - first_row, lane);
  NearestDots nearest[4];
  const int32_t num_tiles = (num_columns + kColumns - 1) / kColumns;
  if (num_tiles > 0) CopyTile(columns, num_columns, tiles[0]);
  for (int32_t t = 0; t < num_tiles; ++t) {
    const int32_t next = (t + 1) * kColumns;
    if (next < num_columns) {
      CopyTile(columns + int64_t{next} * kDescriptorBytes, num_columns - next, tiles[(t + 1) % 2]);
      asm volatile("cp.async.wait_group 1;");
    } else {
      asm volatile("cp.async.wait_group 0;");
    }
    __syncthreads();
#pragma unroll 2
    for (int c = 0; c < kColumns; c += 8) {
      OfferColumns(own, tiles[t % 2] + c * kPitch, t * kColumns + c, lane, nearest);
    }
    __syncthreads();
  }
#pragma unroll
  for (int k = 0; k < 4; ++k) {
    const NearestDots merged = MergeLanes(nearest[k]);
    const int32_t row = first_row + lane / 4 + 8 * k;
    if (lane % 4 != 0 || row >= num_rows) continue;
    p.match_of[pair.out + (back ? pair.num_first : 0) + row] = MatchOf(merged, p.second_limits);
  }
}

// Keeps the matches that are the same in both directions.
__global__ void __launch_bounds__(kBlock) MutualKernel(const DevicePair* pairs, int32_t* match_of) {
  const DevicePair pair = pairs[blockIdx.y];
  const int32_t row = static_cast<int32_t>(blockIdx.x) * kBlock + static_cast<int32_t>(threadIdx.x);
  if (row >= pair.num_first) return;
  int32_t& match = match_of[pair.out + row];
  if (match >= 0 && match_of[pair.out + pair.num_first + match] != row) match = -1;
}

// Lists the pairs for the device, and returns the size of match_of.
int64_t ListPairs(const MatchDescriptorsArgs& args, std::vector<DevicePair>& pairs) {
  int64_t out = 0;
  for (const BlockPair& pair : args.pairs) {
    const int64_t first = args.block_first[pair.first], second = args.block_first[pair.second];
    const auto num_first = static_cast<int32_t>(args.block_first[pair.first + 1] - first);
    const auto num_second = static_cast<int32_t>(args.block_first[pair.second + 1] - second);
    pairs.push_back({first, second, num_first, num_second, out});
    out += num_first + num_second;
  }
  return out;
}

// Collects the matches of the pairs from those of their rows.
void Collect(const std::vector<DevicePair>& pairs, const std::vector<int32_t>& match_of,
             const MatchDescriptorsArgs& args) {
  for (const DevicePair& pair : pairs) {
    for (int32_t row = 0; row < pair.num_first; ++row) {
      const int32_t match = match_of[pair.out + row];
      if (match < 0) continue;
      args.matches->push_back({static_cast<uint32_t>(row), static_cast<uint32_t>(match)});
    }
    args.pair_first->push_back(static_cast<int64_t>(args.matches->size()));
  }
}

}  // namespace

void CudaBackend::MatchDescriptors(const MatchDescriptorsArgs& args) {
  const Turn turn(*this);
  args.pair_first->assign(1, 0);
  args.matches->clear();
  if (!turn || args.pairs.empty()) return;
  std::vector<DevicePair> pairs;
  const int64_t num_rows = ListPairs(args, pairs);
  int32_t longest = 1;
  for (const DevicePair& pair : pairs) {
    longest = std::max({longest, pair.num_first, pair.num_second});
  }
  const auto num_pairs = static_cast<int64_t>(pairs.size());
  const auto take = [&](Arena& arena) {
    return std::pair(arena.Take<DevicePair>(num_pairs), arena.Take<int32_t>(num_rows));
  };
  Arena sizes;
  take(sizes);
  Arena arena(Temporary(sizes.num_bytes()));
  const auto [on_device, match_of] = take(arena);
  if (!error_.empty()) return;
  CopyFromHost(on_device, pairs.data(), pairs.size() * sizeof(DevicePair));
  const auto y = static_cast<unsigned>(num_pairs);
  NearestKernel<<<dim3(NumBlocks(longest, kRows), y, args.mutual ? 2 : 1), kBlock, 0, stream_>>>(
      {args.descriptors.data, on_device, args.second_limits.data, match_of});
  Launched("nearest descriptors");
  if (args.mutual) {
    MutualKernel<<<dim3(NumBlocks(longest, kBlock), y), kBlock, 0, stream_>>>(on_device, match_of);
    Launched("mutual matches");
  }
  std::vector<int32_t> of_rows(num_rows);
  CopyToHost(of_rows.data(), match_of, of_rows.size() * sizeof(int32_t));
  if (error_.empty()) Collect(pairs, of_rows, args);
}

}  // namespace pepeseg
