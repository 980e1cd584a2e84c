#include "kernels/cpu/cpu_backend.h"

namespace pepeseg {

void CpuBackend::Update(const UpdateArgs& args) { (void)args; }

}  // namespace pepeseg
