#include "tests/kernels/backend_test.h"

#include <hwy/targets.h>

#include <cstdlib>
#include <string>

namespace pepeseg {
namespace {

// Makes a CPU backend of 2 threads with this instruction set, or returns nullptr if the machine
// lacks it.
std::unique_ptr<Backend> MakeCpu(int64_t target) {
  if ((hwy::SupportedTargets() & target) == 0) return nullptr;
  hwy::SetSupportedTargetsForTest(target);
  auto backend = MakeCpuBackend(2);
  hwy::SetSupportedTargetsForTest(0);  // the sets of the machine again
  return backend;
}

}  // namespace

std::unique_ptr<Backend> MakeCpuAvx3() { return MakeCpu(HWY_AVX3); }
std::unique_ptr<Backend> MakeCpuVnni() { return MakeCpu(HWY_AVX3_DL); }
std::unique_ptr<Backend> MakeCpuAvx2() { return MakeCpu(HWY_AVX2); }
std::unique_ptr<Backend> MakeCpuSse4() { return MakeCpu(HWY_SSE4); }

std::unique_ptr<Backend> MakeCuda() {
  std::string error;
  auto backend = MakeCudaBackend({}, &error);
  const char* required = std::getenv("PEPESEG_REQUIRE_CUDA");
  if (backend == nullptr && required != nullptr && std::string(required) == "1") {
    ADD_FAILURE() << "PEPESEG_REQUIRE_CUDA=1, but " << error;
  }
  return backend;
}

}  // namespace pepeseg
