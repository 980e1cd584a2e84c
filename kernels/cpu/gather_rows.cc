#include <cassert>

#include "kernels/cpu/cpu_backend.h"

namespace pepeseg {
namespace {

// One plane, or the numbers that go with the Gaussians.
template <class T>
void Gather(const GatherRowsArgs& args, const T* from, T* to) {
  for (int64_t i = 0; i < args.source.size; ++i) {
    assert(args.source[i] >= 0 && args.source[i] < args.from.count);
    const bool zero = !args.is_zero.empty() && args.is_zero[i] != 0;
    to[i] = zero ? T(0) : from[args.source[i]];
  }
}

}  // namespace

// A task is a plane, so that reads stay within one stream of memory.
void CpuBackend::GatherRows(const GatherRowsArgs& args) {
  if (failed()) return;
  assert(args.from.sh_degree == args.to.sh_degree && args.source.size == args.to.count);
  const int num_planes = NumPlanes(args.to.sh_degree);
  pool_.ParallelFor(num_planes + 1, [&](int64_t k, int) {
    const int plane = static_cast<int>(k);
    if (plane < num_planes) {
      Gather(args, args.from.Plane(plane), args.to.Plane(plane));
    } else if (!args.number_to.empty()) {
      Gather(args, args.number_from.data, args.number_to.data);
    }
  });
}

}  // namespace pepeseg
