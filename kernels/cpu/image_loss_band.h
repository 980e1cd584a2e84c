#pragma once

#include "kernels/math/ssim.h"
#include "kernels/ops/render.h"

namespace pepeseg {

inline constexpr int kLossBandRows = 48;  // of one channel: a task, and the order of the sums
inline constexpr int kRowMargin = 16;     // floats of zero left and right of a row: >= any lanes
inline constexpr int kRingRows = 2 * kSsimRadius + 1;

// Some rows of one channel and what is kept while streaming down them. Rows stand `pitch` apart,
// and their pointers are at column 0, after the margin.
struct LossBand {
  const ImageLossArgs* args;
  float l1_weight, ssim_weight;  // of one pixel of one channel
  int channel, first_row, end_row;
  int pitch;                       // width rounded up to 16, and two margins
  float *x, *y;                    // a row of both images
  float* counts;                   // 1, or 0 where the pixel is left out
  float* moment_grad[3];           // of the windows centred in a row
  float* moments;                  // [4, kRingRows, pitch] filtered across; row r at r % kRingRows
  float* gathered;                 // [3, kRingRows, pitch] moment_grad filtered across
  double sums[kNumImageLossSums];  // out
};

}  // namespace pepeseg
