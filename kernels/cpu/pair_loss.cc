#include "kernels/cpu/cpu_backend.h"

namespace pepeseg {

void CpuBackend::PairLoss(const PairLossArgs& args) { (void)args; }

}  // namespace pepeseg
