#pragma once

namespace pepeseg {

// Returns the number of CUDA devices that this process sees. 0: none, or this build has no CUDA.
int NumCudaDevices();

}  // namespace pepeseg
