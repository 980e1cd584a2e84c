#include "kernels/cpu/project.h"

#include <algorithm>
#include <vector>

#include "kernels/backend.h"
#include "kernels/cpu/simd_kernels.h"
#include "kernels/cpu/tile_cover.h"

namespace pepeseg {
namespace {

constexpr int64_t kChunk = 1024;  // Gaussians a task

// Of a chunk, then of all the chunks before it.
struct ChunkCount {
  int64_t num_visible = 0;
  int64_t num_degenerate = 0;
  int64_t num_entries = 0;
};

ChunkCount operator+(const ChunkCount& a, const ChunkCount& b) {
  return {a.num_visible + b.num_visible, a.num_degenerate + b.num_degenerate,
          a.num_entries + b.num_entries};
}

// Fills the chunk's part of the candidates, without gaps.
ChunkCount ProjectChunk(const SimdKernels& simd, const RenderArgs& args, int64_t first) {
  RenderScratch& scratch = *args.scratch;
  const TileGrid grid = {scratch.num_tiles_x, scratch.num_tiles_y};
  int32_t* gaussian = scratch.candidate_gaussian.span().data + first;
  int32_t* num_tiles = scratch.candidate_num_tiles.span().data + first;
  Splat* splat = scratch.candidate_splat.span().data + first;
  const int64_t count = std::min(kChunk, args.gaussians.count - first);
  ProjectJob job = {&args, first, count, gaussian, splat, 0, 0};
  simd.project(job);
  ChunkCount out = {0, job.num_degenerate, 0};
  for (int64_t i = 0; i < job.num_out; ++i) {
    const int covered = NumTiles(splat[i], grid);
    if (covered == 0) continue;
    gaussian[out.num_visible] = gaussian[i];
    splat[out.num_visible] = splat[i];
    num_tiles[out.num_visible++] = covered;
    out.num_entries += covered;
  }
  return out;
}

// From the chunk's candidates to the visible; `before` and `after` are the counts up to its ends.
void MoveChunk(RenderScratch& scratch, int64_t first, const ChunkCount& before,
               const ChunkCount& after) {
  const int64_t count = after.num_visible - before.num_visible;
  std::copy_n(scratch.candidate_gaussian.span().data + first, count,
              scratch.visible_gaussian.span().data + before.num_visible);
  std::copy_n(scratch.candidate_splat.span().data + first, count,
              scratch.visible_splat.span().data + before.num_visible);
  const int32_t* num_tiles = scratch.candidate_num_tiles.span().data + first;
  int32_t* first_slot = scratch.visible_first_slot.span().data + before.num_visible;
  auto slot = static_cast<int32_t>(before.num_entries);
  for (int64_t i = 0; i < count; ++i) {
    first_slot[i] = slot;
    slot += num_tiles[i];
  }
  first_slot[count] = slot;  // the next chunk writes the same, or nobody
}

}  // namespace

void ProjectGaussians(Backend& backend, ThreadPool& pool, const SimdKernels& simd,
                      const RenderArgs& args) {
  RenderScratch& scratch = *args.scratch;
  const int64_t count = args.gaussians.count;
  const int64_t num_chunks = (count + kChunk - 1) / kChunk;
  scratch.candidate_gaussian.Reserve(backend, count);
  scratch.candidate_num_tiles.Reserve(backend, count);
  scratch.candidate_splat.Reserve(backend, count);
  std::vector<ChunkCount> ends(num_chunks + 1);
  pool.ParallelFor(num_chunks, [&](int64_t chunk, int) {
    ends[chunk + 1] = ProjectChunk(simd, args, chunk * kChunk);
  });
  for (int64_t chunk = 0; chunk < num_chunks; ++chunk) {
    ends[chunk + 1] = ends[chunk] + ends[chunk + 1];
  }
  const ChunkCount& sum = ends[num_chunks];
  scratch.visible_gaussian.Reserve(backend, sum.num_visible);
  scratch.visible_splat.Reserve(backend, sum.num_visible);
  scratch.visible_first_slot.Reserve(backend, sum.num_visible + 1);
  scratch.visible_first_slot.span()[0] = 0;
  for (int64_t chunk = 0; chunk < num_chunks; ++chunk) {
    MoveChunk(scratch, chunk * kChunk, ends[chunk], ends[chunk + 1]);
  }
  int64_t* counters = scratch.counters.span().data;
  counters[kNumVisible] = sum.num_visible;
  counters[kNumCulledDegenerate] = sum.num_degenerate;
  counters[kNumTileEntries] = sum.num_entries;
}

}  // namespace pepeseg
