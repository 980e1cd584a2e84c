#include <algorithm>
#include <atomic>
#include <cmath>

#include "kernels/cpu/cpu_backend.h"
#include "kernels/cpu/gaussian_vjp.h"
#include "kernels/cpu/tile_cover.h"
#include "kernels/math/adam.h"

namespace pepeseg {
namespace {

float RateOf(const LearningRates& rates, int plane) {
  if (plane < kLogScalePlane) return rates.mean;
  if (plane < kRotationPlane) return rates.log_scale;
  if (plane < kOpacityPlane) return rates.rotation;
  if (plane < kShPlane) return rates.opacity;
  return plane < kShPlane + 3 ? rates.sh_dc : rates.sh_rest;
}

void UpdateOne(const UpdateArgs& args, int64_t i, const GaussianGrad& grad) {
  const int step = ++args.num_steps[i];
  const AdamRates<float> rates = {
      args.beta1, args.beta2, args.epsilon,
      static_cast<float>(1 / (1 - std::pow(static_cast<double>(args.beta1), step))),
      static_cast<float>(1 / std::sqrt(1 - std::pow(static_cast<double>(args.beta2), step)))};
  for (int k = 0; k < NumPlanes(args.gaussians.sh_degree); ++k) {
    float& value = args.gaussians.Plane(k)[i];
    value += AdamStep(rates, RateOf(args.learning_rates, k), grad.value[k],
                      args.moment1.Plane(k)[i], args.moment2.Plane(k)[i]);
    const bool is_log_scale = k >= kLogScalePlane && k < kRotationPlane;
    if (is_log_scale && args.max_log_scale > args.min_log_scale) {
      value = std::clamp(value, args.min_log_scale, args.max_log_scale);
    }
  }
}

void AddStats(const UpdateArgs& args, int64_t i, const Splat& splat, const SplatGrad& grad) {
  const DensityStats& stats = args.stats;
  if (!stats.mean2d_grad_sum.empty()) {
    const float gx = grad.x * 0.5f * args.view.width, gy = grad.y * 0.5f * args.view.height;
    stats.mean2d_grad_sum[i] += std::sqrt(gx * gx + gy * gy);
  }
  if (!stats.num_visible.empty()) ++stats.num_visible[i];
  if (stats.max_radius.empty()) return;
  stats.max_radius[i] = std::max(stats.max_radius[i], SplatRadius(splat));
}

}  // namespace

void CpuBackend::Update(const UpdateArgs& args) {
  RenderScratch& scratch = *args.scratch;
  const auto camera = MakeProjectionCamera<float>(args.view);
  const int64_t count = args.gaussians.count;
  const auto visible = scratch.visible_gaussian.span();
  constexpr int64_t kChunk = 512;
  std::atomic<int64_t> num_skipped = 0;
  pool_.ParallelFor((count + kChunk - 1) / kChunk, [&](int64_t chunk, int) {
    int64_t v =
        std::lower_bound(visible.data, visible.data + visible.size, chunk * kChunk) - visible.data;
    for (int64_t i = chunk * kChunk; i < std::min(count, (chunk + 1) * kChunk); ++i) {
      GaussianGrad grad = {};
      if (v < visible.size && visible[v] == i) {
        const SplatGrad& splat_grad = scratch.visible_grad.span()[v];
        grad = ProjectGaussianVjp(args.gaussians, camera, args.active_sh_degree, i, splat_grad);
        const bool usable = std::all_of(std::begin(grad.value), std::end(grad.value),
                                        [](float g) { return IsUsable(g); });
        if (usable) {
          AddStats(args, i, scratch.visible_splat.span()[v], splat_grad);
        } else {
          ++num_skipped;
        }
        ++v;
        if (!usable) continue;
      }
      UpdateOne(args, i, grad);
    }
  });
  scratch.counters.span()[kNumSkippedGradientRows] = num_skipped;
}

}  // namespace pepeseg
