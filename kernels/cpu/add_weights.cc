#include "kernels/cpu/cpu_backend.h"

namespace pepeseg {

// One pass over the visible splats: a small share of the time of RenderBackward.
void CpuBackend::AddWeights(const AddWeightsArgs& args) {
  if (failed()) return;
  const RenderScratch& scratch = *args.scratch;
  const DeviceSpan<const int32_t> gaussians = scratch.visible_gaussian.span();
  const SplatGrad* grads = scratch.visible_grad.span().data;
  const int64_t stride = args.sums.size / args.num_planes;
  for (int64_t i = 0; i < gaussians.size; ++i) {
    const float color[3] = {grads[i].r, grads[i].g, grads[i].b};
    for (int k = 0; k < args.num_planes; ++k) args.sums[k * stride + gaussians[i]] += color[k];
  }
}

}  // namespace pepeseg
