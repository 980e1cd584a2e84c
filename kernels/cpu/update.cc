#include <algorithm>
#include <atomic>
#include <cmath>
#include <span>
#include <vector>

#include "kernels/cpu/cpu_backend.h"
#include "kernels/cpu/simd_kernels.h"
#include "kernels/thread_pool.h"

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

constexpr int64_t kChunk = 512;

// Writes to `visible_of` for each of `count` Gaussians from `first` on where it is in `visible`,
// which ascends, or -1.
void InvertVisible(DeviceSpan<const int32_t> visible, int64_t first, int64_t count,
                   int32_t* visible_of) {
  std::fill_n(visible_of, count, -1);
  const int32_t* end = visible.data + visible.size;
  for (const int32_t* v = std::lower_bound(visible.data, end, first);
       v != end && *v < first + count; ++v) {
    visible_of[*v - first] = static_cast<int32_t>(v - visible.data);
  }
}

// Runs SimdKernels::update over all job.count Gaussians, in chunks, and stores the number of
// Gaussians that each step skipped with its scratch. Sets `visible`, `blocks` and the range of each
// chunk's job. blocks: [threads, steps], used where there is more than one step.
void UpdateInChunks(ThreadPool& pool, const SimdKernels& simd, const ParameterJob& job,
                    DeviceSpan<UpdateBlock> blocks) {
  const std::span<const UpdateStep> steps(job.steps, static_cast<size_t>(job.num_steps));
  const int64_t count = job.count;
  std::atomic<int64_t> num_skipped[kMaxUpdateSteps] = {};
  pool.ParallelFor((count + kChunk - 1) / kChunk, [&](int64_t chunk, int thread) {
    ParameterJob part = job;
    UpdateBlock one;  // 60 kB: those of several steps do not belong on the stack
    part.blocks = steps.size() == 1 ? &one : blocks.data + thread * job.num_steps;
    part.first = chunk * kChunk;
    part.count = std::min(kChunk, count - part.first);
    int32_t visible_of[kMaxUpdateSteps][kChunk];
    for (size_t k = 0; k < steps.size(); ++k) {
      InvertVisible(steps[k].scratch->visible_gaussian.span(), part.first, part.count,
                    visible_of[k]);
      part.visible[k] = visible_of[k];
    }
    simd.update(part);
    for (size_t k = 0; k < steps.size(); ++k) num_skipped[k] += part.num_skipped[k];
  });
  for (size_t k = 0; k < steps.size(); ++k) {
    steps[k].scratch->counters.span()[kNumSkippedGradientRows] = num_skipped[k];
  }
}

}  // namespace

// Chunks of Gaussians run in parallel. The table of corrections goes as far as the Gaussian with
// the most steps needs.
void CpuBackend::Update(const UpdateArgs& args) {
  if (failed()) return;
  const auto num_updates = static_cast<int64_t>(args.steps.size());
  Buffer<UpdateBlock> blocks(*this, num_updates > 1 ? num_updates * pool_.num_threads() : 0);
  if (failed()) return;
  const int32_t* steps = args.num_steps.data;
  int32_t most = 0;
  for (int64_t i = 0; i < args.num_steps.size; ++i) most = std::max(most, steps[i]);
  most += static_cast<int32_t>(num_updates);
  const BiasCorrections corrections = MakeCorrections(args, std::min(most, kMaxCorrections));
  ParameterJob job = {};
  job.update = &args;
  job.steps = args.steps.data();
  job.num_steps = static_cast<int>(num_updates);
  job.count = args.gaussians.count;
  job.correction1 = corrections.first.data();
  job.correction2 = corrections.second.data();
  job.num_corrections = static_cast<int32_t>(corrections.first.size());
  UpdateInChunks(pool_, simd_, job, blocks.span());
}

}  // namespace pepeseg
