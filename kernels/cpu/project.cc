#include "kernels/cpu/project.h"

#include <algorithm>
#include <vector>

#include "kernels/backend.h"
#include "kernels/cpu/simd_kernels.h"
#include "kernels/cpu/tile_cover.h"

// Projection in two steps. Chunks of Gaussians are projected in parallel, each into its own range
// of the candidate buffers, without gaps. After a prefix sum of their counts the chunks are moved
// together, so that "visible" is in the order of the Gaussians for any number of threads.

namespace pepeseg {
namespace {

constexpr int64_t kChunk = 1024;  // Gaussians of a task

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
  const int64_t count = std::min(kChunk, args.gaussians.count - first);
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

}  // namespace

void ProjectGaussians(Backend& backend, ThreadPool& pool, const SimdKernels& simd,
                      const RenderArgs& args) {
  RenderScratch& scratch = *args.scratch;
  const int64_t count = args.gaussians.count;
  const int64_t num_chunks = (count + kChunk - 1) / kChunk;
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
    ends[chunk + 1] = ProjectChunk(simd, args, chunk * kChunk, runs[chunk]);
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
    MoveChunk(scratch, chunk * kChunk, ends[chunk], ends[chunk + 1]);
    std::copy(runs[chunk].begin(), runs[chunk].end(),
              scratch.runs.span().data + ends[chunk].num_runs);
  }
}

}  // namespace pepeseg
