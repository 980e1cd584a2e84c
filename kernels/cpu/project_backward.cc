#include "kernels/cpu/cpu_backend.h"

namespace pepeseg {

void CpuBackend::ProjectBackward(const ProjectBackwardArgs& args) { (void)args; }

}  // namespace pepeseg
