#include <algorithm>

#include "kernels/cpu/cpu_backend.h"
#include "kernels/cpu/gaussian_vjp.h"

namespace pepeseg {

void CpuBackend::ProjectBackward(const ProjectBackwardArgs& args) {
  RenderScratch& scratch = *args.scratch;
  const int num_planes = NumPlanes(args.grad.sh_degree);
  for (int k = 0; k < num_planes; ++k) std::fill_n(args.grad.Plane(k), args.grad.count, 0.0f);
  const auto camera = MakeProjectionCamera<float>(args.view);
  constexpr int64_t kChunk = 512;
  const int64_t num_visible = scratch.visible_gaussian.size();
  pool_.ParallelFor((num_visible + kChunk - 1) / kChunk, [&](int64_t chunk, int) {
    for (int64_t v = chunk * kChunk; v < std::min(num_visible, (chunk + 1) * kChunk); ++v) {
      const int64_t i = scratch.visible_gaussian.span()[v];
      const GaussianGrad grad = ProjectGaussianVjp(args.gaussians, camera, args.active_sh_degree, i,
                                                   scratch.visible_grad.span()[v]);
      for (int k = 0; k < num_planes; ++k) args.grad.Plane(k)[i] = grad.value[k];
    }
  });
}

}  // namespace pepeseg
