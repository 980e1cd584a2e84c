#pragma once

#include "kernels/math/ssim.h"
#include "kernels/ops/render.h"

namespace pepeseg {

inline constexpr int kLossBandRows = 48;  // scanlines of a task, and the granularity of the sums
inline constexpr int kRowMargin = 16;  // zeros on either side of a scanline, >= kLanes and radius
inline constexpr int kRingRows = 2 * kSsimRadius + 1;

// Scanlines [first_row, end_row) of one channel, and the working memory for streaming down them.
// Scanlines are `pitch` floats apart, and pointers are at column 0, after the margin.
struct LossBand {
  const ImageLossArgs* args;
  float l1_weight, ssim_weight;  // of one pixel of one channel: loss weight / count
  int channel, first_row, end_row;
  int pitch;              // width rounded up to 16, and two margins
  float *x, *y;           // a scanline of the rendered image and of the photograph
  float* counts;          // 1, or 0 where the pixel is ignored
  float* moment_grad[3];  // gradients of the moments of windows centred on a scanline
  float* moments;   // [4, kRingRows, pitch] moments filtered across; scanline r at r % kRingRows
  float* gathered;  // [3, kRingRows, pitch] moment_grad filtered across
  double sums[kNumImageLossSums];  // out
};

}  // namespace pepeseg
