#pragma once

#include <cuda_runtime_api.h>

#include <cstdint>
#include <span>

#include "kernels/sift_scales.h"

// Blurred images of SIFT on the device (sift_pyramid.cu). Launches on the stream and returns the
// first error of the launches.

namespace pepeseg {

// Octave `index` of a photograph. `temporary` has room for a level of it.
struct SiftBuild {
  const uint8_t* grey;
  int index;
  std::span<const SiftOctave> octaves;
  float* temporary;
  cudaStream_t stream;
};

// Fills the levels of an octave. Octaves from 2 on are made from the one before.
cudaError_t BuildSiftOctave(const SiftBuild& build);

}  // namespace pepeseg
