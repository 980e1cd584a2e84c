#include <algorithm>

#include "kernels/cpu/cpu_backend.h"
#include "kernels/math/adam.h"

namespace pepeseg {
namespace {

constexpr int64_t kRowChunk = 64;  // rows of a task
constexpr int64_t kChunk = 256;    // Gaussians of a task

}  // namespace

// Each row is summed by one task, in the order of its entries.
void CpuBackend::FeatureRows(const FeatureRowsArgs& args) {
  if (failed()) return;
  const int64_t count = args.rows.first.size - 1;
  pool_.ParallelFor((count + kRowChunk - 1) / kRowChunk, [&](int64_t i, int) {
    simd_.feature_rows(args, {i * kRowChunk, std::min(count, (i + 1) * kRowChunk)});
  });
}

// Rows are independent of each other.
void CpuBackend::FeatureCatchUp(const FeatureCatchUpArgs& args) {
  if (failed()) return;
  const int64_t count =
      args.gaussian.empty() ? args.state.last_step.size : int64_t{args.gaussian.size};
  pool_.ParallelFor((count + kChunk - 1) / kChunk, [&](int64_t i, int) {
    simd_.feature_catch_up(args, {i * kChunk, std::min(count, (i + 1) * kChunk)});
  });
}

// Columns are independent of each other. The gate, which is small, is updated serially.
void CpuBackend::FeatureUpdate(const FeatureUpdateArgs& args) {
  if (failed()) return;
  const int64_t count = args.columns.gaussian.size;
  pool_.ParallelFor((count + kChunk - 1) / kChunk, [&](int64_t i, int) {
    simd_.feature_update(args, {i * kChunk, std::min(count, (i + 1) * kChunk)});
  });
  const FeatureRates& r = args.rates;
  // c(step) holds both bias corrections, see FeatureState.
  const AdamRates<float> rates = {r.beta1, r.beta2, r.epsilon, r.correction[args.step], 1};
  for (int64_t k = 0; k < args.gate.size; ++k) {
    args.gate[k] += AdamStep(rates, r.learning_rate, args.gate_grad[k], args.gate_moment1[k],
                             args.gate_moment2[k]);
  }
}

}  // namespace pepeseg
