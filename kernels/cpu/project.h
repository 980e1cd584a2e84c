#pragma once

#include "kernels/cpu/parallel_for.h"
#include "kernels/ops/render.h"

namespace pepeseg {

// Entries are counted in 32 bits.
inline constexpr int64_t kMaxTileEntries = 2'000'000'000;

class Backend;
struct SimdKernels;

// Projects the Gaussians and fills visible_gaussian, visible_splat and visible_first_slot of
// args.scratch, whose sizes in tiles are set, and the counters. Nothing is filled but the counters
// when there are more than kMaxTileEntries.
void ProjectGaussians(Backend& backend, ThreadPool& pool, const SimdKernels& simd,
                      const RenderArgs& args);

}  // namespace pepeseg
