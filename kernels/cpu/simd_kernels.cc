#include "kernels/cpu/simd_kernels.h"

#include <hwy/targets.h>

namespace pepeseg {

// One namespace for each instruction set that kernels/CMakeLists.txt compiles kernels/cpu/simd for.
// Other processors than x86-64 have one set, chosen by the compiler's flags.
#if HWY_ARCH_X86
namespace N_AVX3 {
const SimdKernels& GetSimdKernels();
const SimdKernels& GetSimdKernelsVnni();
}  // namespace N_AVX3
namespace N_AVX2 {
const SimdKernels& GetSimdKernels();
}
namespace N_SSE4 {
const SimdKernels& GetSimdKernels();
}

// SSE4 (x86-64-v2) is assumed without a test. VNNI is used where all extensions of Ice Lake are,
// which Highway calls AVX3_DL.
const SimdKernels& BestSimdKernels() {
  const auto targets = hwy::SupportedTargets();
  if ((targets & HWY_AVX3_DL) != 0) return N_AVX3::GetSimdKernelsVnni();
  if ((targets & HWY_AVX3) != 0) return N_AVX3::GetSimdKernels();
  if ((targets & HWY_AVX2) != 0) return N_AVX2::GetSimdKernels();
  return N_SSE4::GetSimdKernels();
}
#else
namespace HWY_NAMESPACE {
const SimdKernels& GetSimdKernels();
}

const SimdKernels& BestSimdKernels() { return HWY_NAMESPACE::GetSimdKernels(); }
#endif

}  // namespace pepeseg
