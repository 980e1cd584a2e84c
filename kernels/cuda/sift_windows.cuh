#pragma once

#include <cuda_runtime_api.h>

#include <cstdint>

#include "kernels/math/sift.h"
#include "kernels/sift_scales.h"

// Directions and descriptors of the points of SIFT (sift_windows.cu). Launch on the stream.

namespace pepeseg {

// The octaves of a photograph, the finest first, for kernels.
struct SiftPyramid {
  SiftOctave octaves[kSiftOctaves];
};

struct SiftAngles {
  float angle[kMaxOrientations];  // ascending
};

// Finds the directions of `count` sorted points. A point that equals the one before it has none.
// Writes their number to num_angles[count].
void LaunchSiftDirections(const SiftPyramid& pyramid, const SiftFound* points, int count,
                          SiftAngles* angles, int32_t* num_angles, cudaStream_t stream);

struct SiftDescribe {
  SiftPyramid pyramid;
  const SiftFound* points;  // [num_points]
  const SiftAngles* angles;
  const int32_t* first;  // [num_points + 1] first feature of each point
  int num_points;
  SiftKeypoint* keypoints;  // [features] out
  uint8_t* descriptors;     // [features, 128] out
};
void LaunchSiftDescriptors(const SiftDescribe& describe, cudaStream_t stream);

}  // namespace pepeseg
