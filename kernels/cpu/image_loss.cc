#include "kernels/cpu/cpu_backend.h"

namespace pepeseg {

void CpuBackend::ImageLoss(const ImageLossArgs& args) { (void)args; }

}  // namespace pepeseg
