#include <algorithm>
#include <vector>

#include "kernels/cpu/best_similarity.h"
#include "kernels/cpu/cpu_backend.h"

namespace pepeseg {

// Queries are gated and normalised once, pixels for each chunk.
void CpuBackend::Similarity(const SimilarityArgs& args) {
  if (failed()) return;
  constexpr int64_t kChunk = 4096;  // pixels of a task
  const std::vector<float> units = GatedUnits(args.psi.data, args.queries);
  const int64_t count = args.map.size / kFeatureSize;
  pool_.ParallelFor((count + kChunk - 1) / kChunk, [&](int64_t i, int) {
    simd_.similarity(args, units.data(), {i * kChunk, std::min(count, (i + 1) * kChunk)});
  });
}

}  // namespace pepeseg
