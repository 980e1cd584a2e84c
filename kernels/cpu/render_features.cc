#include "kernels/cpu/cpu_backend.h"

namespace pepeseg {

void CpuBackend::RenderFeatures(const RenderFeaturesArgs& args) { (void)args; }

}  // namespace pepeseg
