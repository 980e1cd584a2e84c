#include <algorithm>
#include <atomic>
#include <cmath>
#include <vector>

#include "kernels/cpu/cpu_backend.h"
#include "kernels/cpu/parallel_for.h"
#include "kernels/cpu/simd_kernels.h"

namespace pepeseg {
namespace {

// Later steps use the last correction: 0.999^t is then far below half an ulp of 1 in float. A beta2
// much nearer to 1 would need more.
constexpr int32_t kMaxCorrections = 1 << 15;

struct BiasCorrections {
  std::vector<float> first, second;  // by step, see ParameterJob::correction1 and 2
};

// Corrections for steps 1 to num_steps; powers are of double.
BiasCorrections MakeCorrections(const UpdateArgs& args, int32_t num_steps) {
  BiasCorrections out = {std::vector<float>(num_steps + 1, 1.0f),
                         std::vector<float>(num_steps + 1, 1.0f)};
  double power1 = 1, power2 = 1;
  for (int32_t t = 1; t <= num_steps; ++t) {
    power1 *= args.beta1;
    power2 *= args.beta2;
    out.first[t] = static_cast<float>(1 / (1 - power1));
    out.second[t] = static_cast<float>(1 / std::sqrt(1 - power2));
  }
  return out;
}

// Runs SimdKernels::update over all job.count Gaussians, in chunks, and returns the number of
// Gaussians that were skipped. Sets splats, grads, visible and the range of each chunk's job.
int64_t UpdateInChunks(ThreadPool& pool, const SimdKernels& simd, const RenderScratch& scratch,
                       ParameterJob job) {
  constexpr int64_t kChunk = 512;
  const auto visible = scratch.visible_gaussian.span();
  const int64_t count = job.count;
  job.splats = scratch.visible_splat.span().data;
  job.grads = scratch.visible_grad.span().data;
  std::atomic<int64_t> num_skipped = 0;
  pool.ParallelFor((count + kChunk - 1) / kChunk, [&](int64_t chunk, int) {
    ParameterJob part = job;
    part.first = chunk * kChunk;
    part.count = std::min(kChunk, count - part.first);
    // Inverts the part of visible_gaussian that lies in the chunk; it ascends.
    int32_t visible_of[kChunk];
    std::fill_n(visible_of, kChunk, -1);
    const int32_t* end = visible.data + visible.size;
    for (const int32_t* v = std::lower_bound(visible.data, end, part.first);
         v != end && *v < part.first + part.count; ++v) {
      visible_of[*v - part.first] = static_cast<int32_t>(v - visible.data);
    }
    part.visible = visible_of;
    simd.update(part);
    num_skipped += part.num_skipped;
  });
  return num_skipped;
}

}  // namespace

// Chunks of Gaussians run in parallel. The table of corrections goes as far as the Gaussian with
// the most steps needs.
void CpuBackend::Update(const UpdateArgs& args) {
  if (failed()) return;
  RenderScratch& scratch = *args.scratch;
  const int32_t* steps = args.num_steps.data;
  int32_t most = 0;
  for (int64_t i = 0; i < args.num_steps.size; ++i) most = std::max(most, steps[i]);
  const BiasCorrections corrections = MakeCorrections(args, std::min(most + 1, kMaxCorrections));
  ParameterJob job = {};
  job.update = &args;
  job.count = args.gaussians.count;
  job.correction1 = corrections.first.data();
  job.correction2 = corrections.second.data();
  job.num_corrections = static_cast<int32_t>(corrections.first.size());
  scratch.counters.span()[kNumSkippedGradientRows] = UpdateInChunks(pool_, simd_, scratch, job);
}

}  // namespace pepeseg
