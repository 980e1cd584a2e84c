#include <algorithm>
#include <vector>

#include "kernels/cpu/cpu_backend.h"
#include "kernels/math/pair.h"

namespace pepeseg {

void CpuBackend::Similarity(const SimilarityArgs& args) {
  if (failed()) return;
  constexpr int64_t kChunk = 4096;  // pixels a task
  std::vector<float> units(args.queries.size);
  for (int64_t first = 0; first < args.queries.size; first += kFeatureSize) {
    GatedUnit(args.psi.data, args.queries.data + first, kFeatureSize, units.data() + first);
  }
  const int64_t count = args.map.size / kFeatureSize;
  pool_.ParallelFor((count + kChunk - 1) / kChunk, [&](int64_t i, int) {
    simd_.similarity(args, units.data(), {i * kChunk, std::min(count, (i + 1) * kChunk)});
  });
}

}  // namespace pepeseg
