#pragma once

#include "kernels/cpu/near_forest.h"
#include "kernels/cpu/parallel_for.h"
#include "kernels/cpu/simd_kernels.h"
#include "kernels/ops/cluster.h"

namespace pepeseg {

struct GrowTreeArgs {
  const float* points;  // [n, 32]
  const float* core;    // [n] squared
  float* columns;       // the points as columns (tree_jobs.h); used as working memory
};

// Completes a forest of edges of the minimum spanning tree by Prim's algorithm, which adds a whole
// component at a time, so that each pair of points of different components is examined once.
// Appends to forest.edges, in no particular order.
void GrowTree(const GrowTreeArgs& args, const SimdKernels& simd, ThreadPool& pool, Forest& forest);

}  // namespace pepeseg
