#include "kernels/cpu/project.h"

#include <algorithm>
#include <limits>
#include <vector>

#include "kernels/backend.h"
#include "kernels/cpu/gaussian_vjp.h"
#include "kernels/cpu/tile_cover.h"

namespace pepeseg {
namespace {

constexpr int64_t kChunk = 1024;  // Gaussians a task

enum class Fate { kVisible, kOutside, kDegenerate };

struct ChunkCount {
  int64_t num_visible = 0;
  int64_t num_degenerate = 0;
  int64_t num_entries = 0;
};

float Channel(const RenderArgs& args, int64_t i, const float* basis, int channel) {
  float sum = 0;
  for (int k = 0; k < NumShCoefficients(args.active_sh_degree); ++k) {
    sum += basis[k] * args.gaussians.Plane(kShPlane + 3 * k + channel)[i];
  }
  return ShChannel(sum);
}

Fate ProjectOne(const RenderArgs& args, const ProjectionCamera<float>& camera, int64_t i,
                Splat& splat) {
  const GaussianShape<float> shape = LoadShape(args.gaussians, i);
  const float depth = MeanInCam(camera, shape.mean).z;
  if (!IsUsable(depth)) return Fate::kDegenerate;
  if (depth <= args.near_plane) return Fate::kOutside;
  const Projection<float> p = Project(camera, shape);
  const float opacity = Sigmoid(args.gaussians.Plane(kOpacityPlane)[i]);
  if (!(SquaredNorm(shape.rotation) > kMinSquaredQuaternion) || !IsUsable(p.x) || !IsUsable(p.y) ||
      !(p.determinant > 0) || !IsUsable(p.determinant) || !IsUsable(p.conic.xx) ||
      !IsUsable(p.conic.xy) || !IsUsable(p.conic.yy) || !IsUsable(opacity)) {
    return Fate::kDegenerate;
  }
  const float min_power = MinPower(opacity);
  if (!(min_power < 0)) return Fate::kOutside;
  float basis[16];
  ShBasis(Normalize(shape.mean - CameraCenter(camera)), args.active_sh_degree, basis);
  const float r = Channel(args, i, basis, 0), g = Channel(args, i, basis, 1);
  const float b = Channel(args, i, basis, 2);
  if (!IsUsable(r) || !IsUsable(g) || !IsUsable(b)) return Fate::kDegenerate;
  const auto root = MakePowerRoot(p.conic.xx, p.conic.xy, p.determinant);
  const float half_height = SplatHalfHeight(min_power, root.yy);
  splat = {p.x, p.y, root.xx, root.xy, root.yy, opacity, r, g, b, depth, min_power, half_height};
  return Fate::kVisible;
}

}  // namespace

void ProjectGaussians(Backend& backend, ThreadPool& pool, const RenderArgs& args) {
  RenderScratch& scratch = *args.scratch;
  const int64_t count = args.gaussians.count;
  const TileGrid grid = {scratch.num_tiles_x, scratch.num_tiles_y};
  const int64_t num_chunks = (count + kChunk - 1) / kChunk;
  const auto camera = MakeProjectionCamera<float>(args.view);
  scratch.candidate_gaussian.Reserve(backend, count);
  scratch.candidate_num_tiles.Reserve(backend, count);
  scratch.candidate_splat.Reserve(backend, count);
  int32_t* gaussians = scratch.candidate_gaussian.span().data;
  int32_t* num_tiles = scratch.candidate_num_tiles.span().data;
  Splat* splats = scratch.candidate_splat.span().data;

  std::vector<ChunkCount> chunks(num_chunks);
  pool.ParallelFor(num_chunks, [&](int64_t chunk, int) {
    ChunkCount& total = chunks[chunk];
    int64_t next = chunk * kChunk;
    for (int64_t i = chunk * kChunk; i < std::min(count, (chunk + 1) * kChunk); ++i) {
      const Fate fate = ProjectOne(args, camera, i, splats[next]);
      total.num_degenerate += fate == Fate::kDegenerate;
      if (fate != Fate::kVisible) continue;
      num_tiles[next] = NumTiles(splats[next], grid);
      if (num_tiles[next] == 0) continue;
      gaussians[next] = static_cast<int32_t>(i);
      total.num_entries += num_tiles[next++];
    }
    total.num_visible = next - chunk * kChunk;
  });

  ChunkCount sum;
  for (ChunkCount& chunk : chunks) {  // to the counts of everything before
    const ChunkCount before = sum;
    sum.num_visible += chunk.num_visible;
    sum.num_degenerate += chunk.num_degenerate;
    sum.num_entries += chunk.num_entries;
    chunk = before;
  }
  scratch.visible_gaussian.Reserve(backend, sum.num_visible);
  scratch.visible_splat.Reserve(backend, sum.num_visible);
  scratch.visible_first_slot.Reserve(backend, sum.num_visible + 1);
  int32_t* first_slot = scratch.visible_first_slot.span().data;
  pool.ParallelFor(num_chunks, [&](int64_t chunk, int) {
    const int64_t first = chunks[chunk].num_visible;
    const int64_t end = chunk + 1 < num_chunks ? chunks[chunk + 1].num_visible : sum.num_visible;
    const int64_t from = chunk * kChunk;
    std::copy_n(gaussians + from, end - first, scratch.visible_gaussian.span().data + first);
    std::copy_n(splats + from, end - first, scratch.visible_splat.span().data + first);
    int64_t slot = chunks[chunk].num_entries;
    for (int64_t i = first; i < end; ++i) {
      first_slot[i] = static_cast<int32_t>(slot);
      slot += num_tiles[from + i - first];
    }
  });
  first_slot[sum.num_visible] = static_cast<int32_t>(sum.num_entries);
  int64_t* counters = scratch.counters.span().data;
  counters[kNumVisible] = sum.num_visible;
  counters[kNumCulledDegenerate] = sum.num_degenerate;
  counters[kNumTileEntries] = sum.num_entries;
}

}  // namespace pepeseg
