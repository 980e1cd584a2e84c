#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>
#include <vector>

#include "kernels/cpu/simd_kernels.h"
#include "kernels/math/pair.h"
#include "kernels/ops/feature.h"

namespace pepeseg {

// Returns the queries as SimdKernels::similarity takes them, [num_queries, 32]: gated, of length 1.
inline std::vector<float> GatedUnits(const float* psi, DeviceSpan<const float> queries) {
  std::vector<float> units(static_cast<size_t>(queries.size));
  for (int64_t first = 0; first < queries.size; first += kFeatureSize) {
    GatedUnit(psi, queries.data + first, kFeatureSize, units.data() + first);
  }
  return units;
}

// Writes the largest value of each column of [num_rows, count] to best[count]; -infinity if there
// is no row. A NaN takes no part.
inline void BestOfRows(const float* rows, int64_t num_rows, int64_t count, float* best) {
  std::fill_n(best, count, -std::numeric_limits<float>::infinity());
  for (int64_t row = 0; row < num_rows; ++row) {
    const float* values = rows + row * count;
    for (int64_t i = 0; i < count; ++i) best[i] = std::max(best[i], values[i]);
  }
}

// The largest similarity of each pixel to the positive queries and to the others, [count] each.
struct BestSimilarity {
  const float* positive;
  const float* negative;
};
// Computes them for the `count` pixels of queries.map, of which the first num_positive queries are
// positive. `units` is from GatedUnits. The result points into `scratch`, [num_queries + 2, count];
// queries.similarity is not used.
inline BestSimilarity BestSimilarityOf(const SimdKernels& simd, const SimilarityArgs& queries,
                                       const float* units, int num_positive, float* scratch) {
  const int64_t count = queries.map.size / kFeatureSize;
  const int64_t num_queries = queries.queries.size / kFeatureSize;
  SimilarityArgs each = queries;
  each.similarity = {scratch, num_queries * count};
  simd.similarity(each, units, {0, count});
  float* positive = scratch + num_queries * count;
  float* negative = positive + count;
  BestOfRows(scratch, num_positive, count, positive);
  BestOfRows(scratch + num_positive * count, num_queries - num_positive, count, negative);
  return {positive, negative};
}

}  // namespace pepeseg
