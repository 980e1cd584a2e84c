#include "kernels/cpu/cpu_backend.h"

namespace pepeseg {

void CpuBackend::FeatureUpdate(const FeatureUpdateArgs& args) { (void)args; }

}  // namespace pepeseg
