#pragma once

#include <cstddef>
#include <cstdint>

#include "kernels/buffer.h"

// Arguments of the features of a photograph: SIFT (Lowe 2004; Rey Otero and Delbracio, IPOL 2014)
// with the constants of VLFeat 0.9.21 as COLMAP 3.8 calls it (METHOD.md section 6, "Features").

namespace pepeseg {

inline constexpr int kSiftDescriptorSize = 128;

// The scale space, see kernels/sift_scales.h.
inline constexpr int kSiftOctaves = 4;             // octaves -1 to 2
inline constexpr int kSiftStep = 3;                // scales of an octave that have features
inline constexpr int kSiftLevels = kSiftStep + 3;  // blurred images of an octave
inline constexpr double kSiftBaseSigma = 1.6;      // blur of level 0, pixels
inline constexpr int kMaxSiftRadius = 13;          // of a blur from level to level, pixels

// In pixels of the photograph; the centre of the first pixel is (0.5, 0.5).
struct SiftKeypoint {
  float x, y;
  float scale;  // standard deviation of the blur at which it was found, pixels
  float angle;  // direction of the gradient, radians in [0, 2 pi), from x to y

  bool operator==(const SiftKeypoint&) const = default;
};

// Memory that ExtractSift keeps from one photograph to the next: for each pixel of the largest one
// about 32 bytes, and 96 more if octave -1 was needed. One call at a time may use it.
struct SiftScratch {
  Buffer<float> levels;         // blurred images of octaves 0 to 2
  Buffer<float> finest;         // those of octave -1
  Buffer<std::byte> points[2];  // CUDA: points of octaves 0 to 2, and of octave -1
};

// Finds the features of a grey photograph. Those of the largest scales are kept: scales are taken
// from the largest on, a third of an octave at a time, until there are more than max_features
// points; those of the last scale are all kept, as COLMAP does. A point has one or two directions,
// and is one feature for each. Points that are equal in x, y and scale are one point.
//
// Features are ordered by y, x, scale and angle. A photograph with a side below 3 has none.
// Descriptors are RootSIFT as COLMAP stores them: the square root of the L1-normalised histogram of
// gradients, times 512, rounded, at most 255. Cells are row by row, with 8 directions each.
//
// Waits on the host for the number of features. Memory for the pyramid is the limit of the size.
struct ExtractSiftArgs {
  DeviceSpan<const uint8_t> grey;  // [height, width]
  int width = 0, height = 0;       // each in [1, 16384]
  // [height, width] 1: points within this pixel are not used, and do not count. Empty: all are.
  DeviceSpan<const uint8_t> ignore;
  int max_features = 3000;  // > 0
  SiftScratch* scratch = nullptr;
  Buffer<SiftKeypoint>* keypoints = nullptr;  // [n] sized by the op
  Buffer<uint8_t>* descriptors = nullptr;     // [n, 128] sized by the op
};

}  // namespace pepeseg
