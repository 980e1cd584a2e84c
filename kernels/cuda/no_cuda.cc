// MakeCudaBackend and NumCudaDevices of builds without CUDA. Compiled in place of the .cu files, so
// that callers need no conditional compilation.

#include "kernels/backend.h"
#include "kernels/cuda_devices.h"

namespace pepeseg {

std::unique_ptr<Backend> MakeCudaBackend(const CudaOptions& options, std::string* error) {
  (void)options;
  *error = "this build has no CUDA: it was configured where no nvcc was found";
  return nullptr;
}

int NumCudaDevices() { return 0; }

}  // namespace pepeseg
