#pragma once

#include <algorithm>
#include <atomic>

#include "kernels/cpu/parallel_for.h"
#include "kernels/cpu/simd_kernels.h"

namespace pepeseg {

// Runs SimdKernels::update over all job.count Gaussians, in chunks, and returns the number of
// Gaussians that were skipped. Sets splats, grads, visible and the range of each chunk's job.
inline int64_t UpdateInChunks(ThreadPool& pool, const SimdKernels& simd,
                              const RenderScratch& scratch, ParameterJob job) {
  constexpr int64_t kChunk = 512;
  const auto visible = scratch.visible_gaussian.span();
  const int64_t count = job.count;
  job.splats = scratch.visible_splat.span().data;
  job.grads = scratch.visible_grad.span().data;
  std::atomic<int64_t> num_skipped = 0;
  pool.ParallelFor((count + kChunk - 1) / kChunk, [&](int64_t chunk, int) {
    ParameterJob part = job;
    part.first = chunk * kChunk;
    part.count = std::min(kChunk, count - part.first);
    // Inverts the part of visible_gaussian that lies in the chunk; it ascends.
    int32_t visible_of[kChunk];
    std::fill_n(visible_of, kChunk, -1);
    const int32_t* end = visible.data + visible.size;
    for (const int32_t* v = std::lower_bound(visible.data, end, part.first);
         v != end && *v < part.first + part.count; ++v) {
      visible_of[*v - part.first] = static_cast<int32_t>(v - visible.data);
    }
    part.visible = visible_of;
    simd.update(part);
    num_skipped += part.num_skipped;
  });
  return num_skipped;
}

}  // namespace pepeseg
