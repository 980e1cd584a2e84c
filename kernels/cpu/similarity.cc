#include "kernels/cpu/cpu_backend.h"

namespace pepeseg {

void CpuBackend::Similarity(const SimilarityArgs& args) { (void)args; }

}  // namespace pepeseg
