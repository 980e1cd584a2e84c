#include "kernels/cpu/cpu_backend.h"

namespace pepeseg {

void CpuBackend::FeatureRowsBackward(const FeatureRowsBackwardArgs& args) { (void)args; }

}  // namespace pepeseg
