#include "kernels/cpu/cpu_backend.h"

namespace pepeseg {

void CpuBackend::FeatureRows(const FeatureRowsArgs& args) { (void)args; }

}  // namespace pepeseg
