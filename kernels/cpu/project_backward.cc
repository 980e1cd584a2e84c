#include "kernels/cpu/cpu_backend.h"
#include "kernels/cpu/parameter_chunks.h"

namespace pepeseg {

// The update without Adam: the same kernel stores the gradients instead.
void CpuBackend::ProjectBackward(const ProjectBackwardArgs& args) {
  if (failed()) return;
  ParameterJob job = {};
  job.grad = &args;
  job.count = args.gaussians.count;
  UpdateInChunks(pool_, simd_, *args.scratch, job);
}

}  // namespace pepeseg
