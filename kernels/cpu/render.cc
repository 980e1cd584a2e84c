#include "kernels/cpu/cpu_backend.h"

namespace pepeseg {

void CpuBackend::Render(const RenderArgs& args) { (void)args; }

}  // namespace pepeseg
