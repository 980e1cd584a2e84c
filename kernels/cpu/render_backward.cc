#include "kernels/cpu/cpu_backend.h"

namespace pepeseg {

void CpuBackend::RenderBackward(const RenderBackwardArgs& args) { (void)args; }

}  // namespace pepeseg
