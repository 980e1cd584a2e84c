#pragma once

#include "kernels/cpu/parallel_for.h"
#include "kernels/ops/render.h"

namespace pepeseg {

// Limit on (Gaussian, tile) entries, which are counted in 32 bits.
inline constexpr int64_t kMaxTileEntries = 2'000'000'000;

class Backend;
struct SimdKernels;

// Projects the Gaussians and fills visible_gaussian, visible_splat, visible_first_slot,
// visible_first_run, runs and the counters of args.scratch, whose sizes in tiles must be set. Fills
// only the counters if there are more than kMaxTileEntries. Out of memory is kept by `backend`.
void ProjectGaussians(Backend& backend, ThreadPool& pool, const SimdKernels& simd,
                      const RenderArgs& args);

}  // namespace pepeseg
