#include "kernels/cpu/cpu_backend.h"

namespace pepeseg {

void CpuBackend::CaptureRows(const CaptureRowsArgs& args) { (void)args; }

}  // namespace pepeseg
