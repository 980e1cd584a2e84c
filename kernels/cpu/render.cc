#include "kernels/ops/render.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cassert>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "kernels/backend.h"
#include "kernels/cpu/cpu_backend.h"
#include "kernels/cpu/simd_kernels.h"
#include "kernels/cpu/tile_splats.h"
#include "kernels/half.h"
#include "kernels/math/blend.h"
#include "kernels/math/tile_cover.h"
#include "kernels/thread_pool.h"

// Render: projection, the list of entries, and blending; and the feature map of the same view.
//
// Projection has two steps. Chunks of Gaussians are projected in parallel, each into its own range
// of the candidate buffers, without gaps. After a prefix sum of their counts the chunks are moved
// together, so that "visible" is in the order of the Gaussians for any number of threads.
//
// Entries: sorting the visible splats once by depth and then appending each to its tiles gives
// every tile's entries in order of depth, without sorting the far more numerous entries. Serial and
// stable, so the order is fixed.

namespace pepeseg {
namespace {

// Limit on (Gaussian, tile) entries, which are counted in 32 bits.
constexpr int64_t kMaxTileEntries = 2'000'000'000;

constexpr int64_t kProjectChunk = 1024;  // Gaussians of a task

// Counts of a chunk, then sums over all chunks up to its end.
struct ChunkCount {
  int64_t num_visible = 0;
  int64_t num_degenerate = 0;
  int64_t num_entries = 0;
  int64_t num_runs = 0;
};

ChunkCount operator+(const ChunkCount& a, const ChunkCount& b) {
  return {a.num_visible + b.num_visible, a.num_degenerate + b.num_degenerate,
          a.num_entries + b.num_entries, a.num_runs + b.num_runs};
}

// Projects the chunk from `first` on: fills its part of the candidates and appends their tile runs
// to `runs`. A splat that reaches no tile is dropped.
ChunkCount ProjectChunk(const SimdKernels& simd, const RenderArgs& args, int64_t first,
                        std::vector<TileRun>& runs) {
  RenderScratch& scratch = *args.scratch;
  const TileGrid grid = {scratch.num_tiles_x, scratch.num_tiles_y};
  int32_t* gaussian = scratch.candidate_gaussian.span().data + first;
  int32_t* num_tiles = scratch.candidate_num_tiles.span().data + first;
  int32_t* num_runs = scratch.candidate_num_runs.span().data + first;
  Splat* splat = scratch.candidate_splat.span().data + first;
  const int64_t count = std::min(kProjectChunk, args.gaussians.count - first);
  ProjectJob job = {&args, first, count, gaussian, splat, 0, 0};
  simd.project(job);
  ChunkCount out = {0, job.num_degenerate, 0, 0};
  for (int64_t i = 0; i < job.num_out; ++i) {
    const size_t num_before = runs.size();
    int32_t covered = 0;
    ForEachTileRun(splat[i], grid, [&](const TileRun& run) {
      runs.push_back(run);
      covered += run.count;
    });
    if (covered == 0) continue;
    gaussian[out.num_visible] = gaussian[i];
    splat[out.num_visible] = splat[i];
    num_tiles[out.num_visible] = covered;
    num_runs[out.num_visible++] = static_cast<int32_t>(runs.size() - num_before);
    out.num_entries += covered;
  }
  out.num_runs = static_cast<int64_t>(runs.size());
  return out;
}

// Writes firsts[i] = start + the sum of counts before i, for i in [0, count].
void WriteFirsts(const int32_t* counts, int64_t count, int64_t start, int32_t* firsts) {
  auto next = static_cast<int32_t>(start);
  for (int64_t i = 0; i < count; ++i) {
    firsts[i] = next;
    next += counts[i];
  }
  firsts[count] = next;
}

// Moves the candidates of the chunk at `first` to the visible. `before` and `after` are the sums up
// to its begin and end. Adjacent chunks write the same value where they meet.
void MoveChunk(RenderScratch& scratch, int64_t first, const ChunkCount& before,
               const ChunkCount& after) {
  const int64_t to = before.num_visible, count = after.num_visible - to;
  std::copy_n(scratch.candidate_gaussian.span().data + first, count,
              scratch.visible_gaussian.span().data + to);
  std::copy_n(scratch.candidate_splat.span().data + first, count,
              scratch.visible_splat.span().data + to);
  WriteFirsts(scratch.candidate_num_tiles.span().data + first, count, before.num_entries,
              scratch.visible_first_slot.span().data + to);
  WriteFirsts(scratch.candidate_num_runs.span().data + first, count, before.num_runs,
              scratch.visible_first_run.span().data + to);
}

// Projects the Gaussians and fills visible_gaussian, visible_splat, visible_first_slot,
// visible_first_run, runs and the counters of args.scratch, whose sizes in tiles must be set. Fills
// only the counters if there are more than kMaxTileEntries. Out of memory is kept by `backend`.
void ProjectGaussians(Backend& backend, ThreadPool& pool, const SimdKernels& simd,
                      const RenderArgs& args) {
  RenderScratch& scratch = *args.scratch;
  const int64_t count = args.gaussians.count;
  const int64_t num_chunks = (count + kProjectChunk - 1) / kProjectChunk;
  if (!scratch.candidate_gaussian.Reserve(backend, count) ||
      !scratch.candidate_num_tiles.Reserve(backend, count) ||
      !scratch.candidate_num_runs.Reserve(backend, count) ||
      !scratch.candidate_splat.Reserve(backend, count)) {
    return;
  }
  // ends[i + 1] first holds the counts of chunk i, then the sums up to its end.
  std::vector<ChunkCount> ends(num_chunks + 1);
  std::vector<std::vector<TileRun>> runs(num_chunks);
  pool.ParallelFor(num_chunks, [&](int64_t chunk, int) {
    ends[chunk + 1] = ProjectChunk(simd, args, chunk * kProjectChunk, runs[chunk]);
  });
  for (int64_t chunk = 0; chunk < num_chunks; ++chunk) {
    ends[chunk + 1] = ends[chunk] + ends[chunk + 1];
  }
  const ChunkCount& sum = ends[num_chunks];
  int64_t* counters = scratch.counters.span().data;
  counters[kNumVisible] = sum.num_visible;
  counters[kNumCulledDegenerate] = sum.num_degenerate;
  counters[kNumTileEntries] = sum.num_entries;
  // The caller reports too many entries.
  if (sum.num_entries > kMaxTileEntries ||
      !scratch.visible_gaussian.Reserve(backend, sum.num_visible) ||
      !scratch.visible_splat.Reserve(backend, sum.num_visible) ||
      !scratch.visible_first_slot.Reserve(backend, sum.num_visible + 1) ||
      !scratch.visible_first_run.Reserve(backend, sum.num_visible + 1) ||
      !scratch.runs.Reserve(backend, sum.num_runs)) {
    return;
  }
  scratch.visible_first_slot.span()[0] = scratch.visible_first_run.span()[0] = 0;
  for (int64_t chunk = 0; chunk < num_chunks; ++chunk) {
    MoveChunk(scratch, chunk * kProjectChunk, ends[chunk], ends[chunk + 1]);
    std::copy(runs[chunk].begin(), runs[chunk].end(),
              scratch.runs.span().data + ends[chunk].num_runs);
  }
}

constexpr int kDigitBits = 11;
constexpr int kNumDigits = 1 << kDigitBits;

// Stable least-significant-digit radix sort by the upper 32 bits. Both arrays are overwritten;
// returns the one that holds the result.
uint64_t* RadixSort(uint64_t* keys, uint64_t* spare, int64_t count) {
  constexpr int kNumPasses = 3;
  std::array<std::array<int32_t, kNumDigits>, kNumPasses> starts = {};
  const auto digit = [](uint64_t key, int pass) {
    return static_cast<int>(key >> (32 + pass * kDigitBits)) & (kNumDigits - 1);
  };
  // One pass counts the digits of all passes.
  for (int64_t i = 0; i < count; ++i) {
    for (int pass = 0; pass < kNumPasses; ++pass) ++starts[pass][digit(keys[i], pass)];
  }
  for (int pass = 0; pass < kNumPasses; ++pass) {
    int32_t next = 0;
    for (int32_t& start : starts[pass]) next += std::exchange(start, next);
    for (int64_t i = 0; i < count; ++i) spare[starts[pass][digit(keys[i], pass)]++] = keys[i];
    std::swap(keys, spare);
  }
  return keys;
}

// Returns the visible by ascending depth, in the lower 32 bits, or nullptr when out of memory.
// Depths are positive, so their bits order as they do. Once the keys are taken, depths are inverted
// if the inverse is to be blended.
const uint64_t* SortByDepth(Backend& backend, RenderScratch& scratch) {
  const int64_t num_visible = scratch.visible_splat.size();
  if (!scratch.sort_keys.Reserve(backend, 2 * num_visible)) return nullptr;
  uint64_t* keys = scratch.sort_keys.span().data;
  Splat* splats = scratch.visible_splat.span().data;
  for (int64_t i = 0; i < num_visible; ++i) {
    assert(keys != nullptr);
    keys[i] = uint64_t{std::bit_cast<uint32_t>(splats[i].depth)} << 32 | static_cast<uint64_t>(i);
    if (scratch.inverse_depth) splats[i].depth = InverseDepth(splats[i].depth);
  }
  return RadixSort(keys, keys + num_visible, num_visible);
}

// Lists the entries: sorts the visible by depth (equal depths by index), then lists them tile by
// tile. Reads what ProjectGaussians filled; fills tile_first_entry, entry_visible and entry_slot.
// Inverts Splat::depth after a render of inverse depth. Out of memory is kept by `backend`.
void ListTileEntries(Backend& backend, RenderScratch& scratch) {
  const int64_t num_visible = scratch.visible_splat.size();
  const int num_tiles = scratch.num_tiles_x * scratch.num_tiles_y;
  const int32_t* first_slot = scratch.visible_first_slot.span().data;
  const int32_t* first_run = scratch.visible_first_run.span().data;
  const TileRun* runs = scratch.runs.span().data;
  if (!scratch.tile_first_entry.Reserve(backend, num_tiles + 1) ||
      !scratch.entry_visible.Reserve(backend, first_slot[num_visible]) ||
      !scratch.entry_slot.Reserve(backend, first_slot[num_visible]) ||
      (scratch.for_backward && !scratch.entry_blocks.Reserve(backend, first_slot[num_visible]))) {
    return;
  }
  int32_t* tile_first = scratch.tile_first_entry.span().data;
  int32_t* entry_visible = scratch.entry_visible.span().data;
  int32_t* entry_slot = scratch.entry_slot.span().data;
  assert(tile_first != nullptr);

  // Counts the entries of each tile by differences: plus one where a run starts, minus one where it
  // ends. Their running sum is the count, and the running sum of counts the first entry.
  std::vector<int32_t> change(num_tiles + 1), next(num_tiles);
  for (int64_t i = 0; i < scratch.runs.size(); ++i) {
    ++change[runs[i].first_tile];
    --change[runs[i].first_tile + runs[i].count];
  }
  int32_t first = 0, count = 0;
  for (int tile = 0; tile < num_tiles; ++tile) {
    tile_first[tile] = next[tile] = first;
    first += count += change[tile];
  }
  tile_first[num_tiles] = first;

  const uint64_t* order = SortByDepth(backend, scratch);
  if (order == nullptr) return;
  const auto visible_at = [&](int64_t i) { return static_cast<int32_t>(order[i] & 0xffffffffu); };
  for (int64_t i = 0; i < num_visible; ++i) {
    // In the order of depth, runs are scattered in memory.
    if (i + 16 < num_visible) {
      __builtin_prefetch(first_run + visible_at(i + 16));
      __builtin_prefetch(first_slot + visible_at(i + 16));
      __builtin_prefetch(runs + first_run[visible_at(i + 8)]);
    }
    const int32_t visible = visible_at(i);
    // Slots of a splat follow its runs, so their order does not depend on depth.
    int32_t slot = first_slot[visible];
    for (int32_t r = first_run[visible]; r < first_run[visible + 1]; ++r) {
      for (int32_t tile = runs[r].first_tile; tile < runs[r].first_tile + runs[r].count; ++tile) {
        const int32_t entry = next[tile]++;
        assert(entry_visible != nullptr && entry_slot != nullptr);
        entry_visible[entry] = visible;
        entry_slot[entry] = slot++;
      }
    }
  }
}

}  // namespace

// Projects the Gaussians, lists their entries by tile and depth, then blends the tiles in parallel.
// Each pixel is blended by one task, front to back.
void CpuBackend::Render(const RenderArgs& args) {
  if (failed()) return;
  RenderScratch& scratch = *args.scratch;
  scratch.width = args.view.width;
  scratch.height = args.view.height;
  scratch.num_tiles_x = (args.view.width + kTileSize - 1) / kTileSize;
  scratch.num_tiles_y = (args.view.height + kTileSize - 1) / kTileSize;
  scratch.inverse_depth = args.inverse_depth;
  scratch.for_backward = args.for_backward;
  const int64_t num_pixels = int64_t{scratch.width} * scratch.height;
  if (!scratch.counters.Reserve(*this, kNumRenderCounters) ||
      !scratch.pixel_transmittance.Reserve(*this, num_pixels) ||
      !scratch.pixel_last_entry.Reserve(*this, num_pixels)) {
    return;
  }
  scratch.counters.Zero();
  ProjectGaussians(*this, pool_, simd_, args);
  if (failed()) return;
  if (const int64_t num_entries = scratch.counters.span()[kNumTileEntries];
      num_entries > kMaxTileEntries) {
    return Fail({"render: " + std::to_string(num_entries) +
                 " pairs of Gaussian and tile, at most " + std::to_string(kMaxTileEntries) +
                 " are possible"});
  }
  ListTileEntries(*this, scratch);
  if (failed()) return;
  ImageColors image = {};
  // Alpha and depth are written unless their pointers are null.
  image.stride = scratch.width;
  image.r = args.color.data;
  image.g = image.r + num_pixels;
  image.b = image.g + num_pixels;
  image.alpha = args.alpha.data;
  image.depth = args.depth.data;
  image.transmittance = scratch.pixel_transmittance.span().data;
  image.last = scratch.pixel_last_entry.span().data;
  if (args.for_backward) image.entry_blocks = scratch.entry_blocks.span().data;
  pool_.ParallelFor(NumTilesOf(scratch),
                    [&](int64_t i, int) { simd_.blend_tile(TileAt(scratch, i), image); });
}

// Tiles run in parallel. A tile is summed in float, in the working memory of its thread, and
// rounded to half once.
void CpuBackend::RenderFeatures(const RenderFeaturesArgs& args) {
  if (failed()) return;
  const RenderScratch& scratch = *args.scratch;
  constexpr int kTileValues = kTilePixels * kFeatureSize;
  std::vector<float> sums(pool_.num_threads() * kTileValues);
  pool_.ParallelFor(NumTilesOf(scratch), [&](int64_t i, int thread) {
    const TileSplats tile = TileAt(scratch, i);
    float* tile_sums = sums.data() + thread * kTileValues;
    simd_.blend_features(tile, args.features.data, args.confidence.data,
                         scratch.visible_gaussian.span().data, tile_sums);
    ForEachTilePixel(tile, scratch.width, [&](int64_t out, int in) {
      const float* from = tile_sums + in * kFeatureSize;
      std::transform(from, from + kFeatureSize, args.map.data + out * kFeatureSize, HalfFromFloat);
    });
  });
}

}  // namespace pepeseg
