#pragma once

#include "kernels/cpu/parallel_for.h"
#include "kernels/ops.h"

namespace pepeseg {

class Backend;
struct SimdKernels;

// Projects the Gaussians and fills visible_gaussian, visible_splat and visible_first_slot of
// args.scratch, whose sizes in tiles are set, and the counters.
void ProjectGaussians(Backend& backend, ThreadPool& pool, const SimdKernels& simd,
                      const RenderArgs& args);

}  // namespace pepeseg
