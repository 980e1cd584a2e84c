#include <algorithm>

#include "kernels/cpu/cpu_backend.h"

namespace pepeseg {
namespace {

constexpr int64_t kChunk = 64;  // rows of a task

}  // namespace

// Each row is summed by one task, in the order of its entries.
void CpuBackend::FeatureRows(const FeatureRowsArgs& args) {
  if (failed()) return;
  const int64_t count = args.rows.first.size - 1;
  pool_.ParallelFor((count + kChunk - 1) / kChunk, [&](int64_t i, int) {
    simd_.feature_rows(args, {i * kChunk, std::min(count, (i + 1) * kChunk)});
  });
}

}  // namespace pepeseg
