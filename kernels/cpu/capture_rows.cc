#include <algorithm>

#include "kernels/cpu/cpu_backend.h"
#include "kernels/cpu/pixel_row.h"

namespace pepeseg {
namespace {

constexpr int64_t kChunk = 16;  // pixels a task

}  // namespace

void CpuBackend::CaptureRows(const CaptureRowsArgs& args) {
  const RenderScratch& scratch = *args.scratch;
  const int64_t num_pixels = args.pixels.size;
  const int64_t num_chunks = (num_pixels + kChunk - 1) / kChunk;
  args.row_first->Reserve(*this, num_pixels + 1);
  int32_t* row_first = args.row_first->span().data;
  row_first[0] = 0;
  pool_.ParallelFor(num_chunks, [&](int64_t chunk, int) {
    for (int64_t i = chunk * kChunk; i < std::min(num_pixels, (chunk + 1) * kChunk); ++i) {
      int32_t num_blended = 0;
      ForEachBlended(scratch, args.pixels[i], [&](int32_t, float) { ++num_blended; });
      row_first[i + 1] = num_blended;
    }
  });
  for (int64_t i = 0; i < num_pixels; ++i) row_first[i + 1] += row_first[i];

  args.entry_gaussian->Reserve(*this, row_first[num_pixels]);
  args.entry_weight->Reserve(*this, row_first[num_pixels]);
  int32_t* entry_gaussian = args.entry_gaussian->span().data;
  float* entry_weight = args.entry_weight->span().data;
  pool_.ParallelFor(num_chunks, [&](int64_t chunk, int) {
    for (int64_t i = chunk * kChunk; i < std::min(num_pixels, (chunk + 1) * kChunk); ++i) {
      int32_t next = row_first[i];
      float alpha = 0, depth = 0;
      ForEachBlended(scratch, args.pixels[i], [&](int32_t visible, float weight) {
        entry_gaussian[next] = scratch.visible_gaussian.span()[visible];
        entry_weight[next++] = weight;
        alpha += weight;
        depth += weight * scratch.visible_splat.span()[visible].depth;
      });
      if (!args.pixel_alpha.empty()) args.pixel_alpha[i] = alpha;
      if (!args.pixel_depth.empty()) args.pixel_depth[i] = depth;
    }
  });
}

}  // namespace pepeseg
