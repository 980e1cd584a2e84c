#include <cuda_runtime.h>

#include <cstdint>
#include <cub/device/device_scan.cuh>
#include <utility>
#include <vector>

#include "kernels/cuda/cuda_backend.h"
#include "kernels/math/warp_cell.h"
#include "kernels/ops/cell_masks.h"

// SuppressMasks and EnlargeMasks (kernels/ops/cell_masks.h).
//
// SuppressMasks, three kernels:
//   PairKernel  one warp per pair of candidates writes whether the better one makes the other
//               needless: a bit of a matrix, set by an atomic. Most pairs end at their areas.
//   ScanKernel  one warp examines the candidates in order. A lane keeps words of the set of
//   needless
//               candidates; each kept one adds its row of the matrix.
//   CopyKernel  a block copies the bits of a kept mask to its place.
// EnlargeMasks: RunsKernel, one warp per scanline of a mask, is launched twice: it counts runs, and
// after a scan over the counts writes them. Lanes have neighbouring pixels; a ballot gives the
// warp all of them, and a run begins where a bit differs from the one before.

namespace pepeseg {
namespace {

constexpr int kBlock = 256, kWarps = kBlock / 32;

struct PairParams {
  SuppressMasksArgs args;
  int num_words;       // of a row of the matrix
  uint32_t* needless;  // [candidates, num_words]: row of the better one
};

__global__ void __launch_bounds__(kBlock) PairKernel(PairParams p) {
  const SuppressMasksArgs& args = p.args;
  const auto lane = static_cast<int>(threadIdx.x) % 32;
  const auto better = static_cast<int>(blockIdx.y);
  const int other = static_cast<int>(blockIdx.x) * kWarps + static_cast<int>(threadIdx.x) / 32;
  if (other <= better || other >= args.candidates.size) return;
  const uint32_t* a = args.bits.data + int64_t{args.candidates.data[other]} * args.words;
  const uint32_t* b = args.bits.data + int64_t{args.candidates.data[better]} * args.words;
  const int32_t cell = args.filler_cells.data[other];
  bool needless = cell >= 0 && (b[cell / 32] >> (cell % 32) & 1u) != 0;
  const int32_t area_a = args.areas.data[other], area_b = args.areas.data[better];
  // The IoU is at most the ratio of the areas.
  if (!needless && min(area_a, area_b) > args.max_iou * max(area_a, area_b)) {
    int common = 0;
    for (int word = lane; word < args.words; word += 32) common += __popc(a[word] & b[word]);
    common = __reduce_add_sync(~0u, common);
    needless =
        static_cast<double>(common) / static_cast<double>(area_a + area_b - common) > args.max_iou;
  }
  if (needless && lane == 0) {
    atomicOr(p.needless + int64_t{better} * p.num_words + other / 32, 1u << (other % 32));
  }
}

constexpr int kWordsOfLane = 8;
constexpr int kMaxCandidates = 32 * 32 * kWordsOfLane;

// order: [candidates] number of a kept candidate among the kept; -1: dropped.
__global__ void ScanKernel(PairParams p, int32_t* order) {
  const auto lane = static_cast<int>(threadIdx.x);
  uint32_t needless[kWordsOfLane] = {};  // words lane, lane + 32, ...
  int num_kept = 0;
  for (int i = 0; i < p.args.candidates.size; ++i) {
    uint32_t word = 0;
#pragma unroll
    for (int k = 0; k < kWordsOfLane; ++k) word = i / 1024 == k ? needless[k] : word;
    word = __shfl_sync(~0u, word, i / 32 % 32);
    const bool kept = (word >> (i % 32) & 1u) == 0;
    if (lane == 0) {
      p.args.kept.data[i] = kept;
      order[i] = kept ? num_kept : -1;
    }
    if (!kept) continue;
    ++num_kept;
#pragma unroll
    for (int k = 0; k < kWordsOfLane; ++k) {
      const int at = lane + 32 * k;
      if (at < p.num_words) needless[k] |= p.needless[int64_t{i} * p.num_words + at];
    }
  }
}

__global__ void __launch_bounds__(kBlock) CopyKernel(SuppressMasksArgs args, const int32_t* order) {
  const int32_t to = order[blockIdx.x];
  if (to < 0) return;
  const uint32_t* from = args.bits.data + int64_t{args.candidates.data[blockIdx.x]} * args.words;
  for (int word = static_cast<int>(threadIdx.x); word < args.words; word += kBlock) {
    args.kept_bits.data[int64_t{to} * args.words + word] = from[word];
  }
}

struct RunsParams {
  EnlargeMasksArgs args;
  const WarpedCell *columns, *rows;
  int32_t* first_run;  // [scanlines + 1]
  int32_t* runs;       // null: count only, into first_run
};

__global__ void __launch_bounds__(kBlock) RunsKernel(RunsParams p) {
  const EnlargeMasksArgs& args = p.args;
  const auto lane = static_cast<int>(threadIdx.x) % 32;
  const int y = static_cast<int>(blockIdx.x) * kWarps + static_cast<int>(threadIdx.x) / 32;
  if (y >= args.photo_height) return;
  const int64_t scanline = int64_t{blockIdx.y} * args.photo_height + y;
  const int8_t* mask =
      args.quarters.data + int64_t{args.masks.data[blockIdx.y]} * args.extent * args.extent;
  const WarpedCell row = p.rows[y];
  int32_t* out = p.runs == nullptr ? nullptr : p.runs + 2 * int64_t{p.first_run[scanline]};
  int num_changes = 0;
  uint32_t before = 0;  // the pixel left of the next 32
  // One more step past the end ends a run that reaches it.
  for (int first = 0; first <= args.photo_width; first += 32) {
    const int x = first + lane;
    bool holds = false;
    if (x < args.photo_width) {
      holds = WarpedLogit(mask, args.extent, p.columns[x], row) > 0 &&
              (args.ignored.size == 0 || args.ignored.data[int64_t{y} * args.photo_width + x] == 0);
    }
    const uint32_t pixels = __ballot_sync(~0u, holds);
    const uint32_t changes = pixels ^ (pixels << 1 | before);
    if (out != nullptr && (changes >> lane & 1u) != 0) {
      out[num_changes + __popc(changes & ((1u << lane) - 1u))] = x;
    }
    num_changes += __popc(changes);
    before = pixels >> 31;
  }
  if (out == nullptr && lane == 0) p.first_run[scanline] = num_changes / 2;
}

}  // namespace

void CudaBackend::SuppressMasks(const SuppressMasksArgs& args) {
  const Turn turn(*this);
  const auto count = static_cast<int>(args.candidates.size);
  if (!turn || count == 0) return;
  if (count > kMaxCandidates) {
    return Fail({"CUDA: " + std::to_string(count) + " masks to suppress exceed the limit of " +
                     std::to_string(kMaxCandidates),
                 false});
  }
  const int num_words = (count + 31) / 32;
  const auto take = [&](Arena& arena) {
    auto* needless = arena.Take<uint32_t>(int64_t{count} * num_words);
    return std::pair(needless, arena.Take<int32_t>(count));
  };
  Arena sizes;
  take(sizes);
  Arena arena(Temporary(sizes.num_bytes()));
  const auto [needless, order] = take(arena);
  if (!error_.empty()) return;
  Zero(needless, static_cast<size_t>(count) * num_words * sizeof(uint32_t));
  const PairParams params = {args, num_words, needless};
  PairKernel<<<dim3(NumBlocks(count, kWarps), count), kBlock, 0, stream_>>>(params);
  Launched("pairs of masks");
  ScanKernel<<<1, 32, 0, stream_>>>(params, order);
  Launched("suppress masks");
  CopyKernel<<<count, kBlock, 0, stream_>>>(args, order);
  Launched("copy kept masks");
}

void CudaBackend::EnlargeMasks(const EnlargeMasksArgs& args) {
  const Turn turn(*this);
  const int64_t num_scanlines = args.masks.size * args.photo_height;
  if (!turn || !args.first_run->Reserve(*this, num_scanlines + 1)) return;
  args.first_run->Zero();
  args.runs->Reserve(*this, 0);
  if (num_scanlines == 0) return;
  const auto columns = CellsOfPixels(args.cells_per_pixel, args.photo_width, args.width, true);
  const auto rows = CellsOfPixels(args.cells_per_pixel, args.photo_height, args.height, false);
  size_t scan_bytes = 0;
  int32_t* const first_run = args.first_run->span().data;
  Keep(cub::DeviceScan::ExclusiveSum(nullptr, scan_bytes, first_run, first_run, num_scanlines + 1),
       "sizing a scan");
  struct Taken {
    WarpedCell *columns, *rows;
    std::byte* scan;
  };
  const auto take = [&](Arena& arena) {
    return Taken{arena.Take<WarpedCell>(args.photo_width),
                 arena.Take<WarpedCell>(args.photo_height),
                 arena.Take<std::byte>(static_cast<int64_t>(scan_bytes))};
  };
  Arena sizes;
  take(sizes);
  Arena arena(Temporary(sizes.num_bytes()));
  const Taken taken = take(arena);
  if (!error_.empty()) return;
  CopyFromHost(taken.columns, columns.data(), columns.size() * sizeof(WarpedCell));
  CopyFromHost(taken.rows, rows.data(), rows.size() * sizeof(WarpedCell));
  RunsParams params = {args, taken.columns, taken.rows, first_run, nullptr};
  const dim3 grid(NumBlocks(args.photo_height, kWarps), static_cast<unsigned>(args.masks.size));
  RunsKernel<<<grid, kBlock, 0, stream_>>>(params);
  Launched("count runs");
  Keep(cub::DeviceScan::ExclusiveSum(taken.scan, scan_bytes, first_run, first_run,
                                     num_scanlines + 1, stream_),
       "scanning runs");
  Launched("scan runs");
  int32_t num_runs = 0;
  CopyToHost(&num_runs, first_run + num_scanlines, sizeof(num_runs));
  if (!error_.empty() || !args.runs->Reserve(*this, 2 * int64_t{num_runs}) || num_runs == 0) return;
  params.runs = args.runs->span().data;
  RunsKernel<<<grid, kBlock, 0, stream_>>>(params);
  Launched("write runs");
}

}  // namespace pepeseg
