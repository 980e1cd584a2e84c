#include <cassert>

#include "kernels/cpu/cpu_backend.h"

namespace pepeseg {

void CpuBackend::GatherRows(const GatherRowsArgs& args) {
  assert(args.from.sh_degree == args.to.sh_degree && args.source.size == args.to.count);
  pool_.ParallelFor(NumPlanes(args.to.sh_degree), [&](int64_t k, int) {
    const float* from = args.from.Plane(static_cast<int>(k));
    float* to = args.to.Plane(static_cast<int>(k));
    for (int64_t i = 0; i < args.to.count; ++i) {
      const int32_t source = args.source[i];
      assert(source < args.from.count);
      to[i] = source < 0 ? 0.0f : from[source];
    }
  });
}

}  // namespace pepeseg
