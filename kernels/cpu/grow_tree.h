#pragma once

#include "kernels/cpu/near_forest.h"
#include "kernels/cpu/parallel_for.h"
#include "kernels/cpu/simd_kernels.h"
#include "kernels/ops/cluster.h"

namespace pepeseg {

struct GrowTreeArgs {
  const float* points;  // [n, 32]
  const float* core;    // [n] squared
  float* columns;       // the points as columns (tree_jobs.h); overwritten
};

// Completes a forest of edges of the minimum spanning tree by Prim's algorithm, which takes a
// component at a time: each pair of points of different components is looked at once.
void GrowTree(const GrowTreeArgs& args, const SimdKernels& simd, ThreadPool& pool, Forest& forest);

}  // namespace pepeseg
