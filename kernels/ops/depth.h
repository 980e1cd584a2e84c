#pragma once

#include <cstdint>

#include "kernels/buffer.h"

// Arguments of the comparison of rendered depth with a monocular prior (stage one).

namespace pepeseg {

// Where the prior is fitted besides the whole view.
enum class DepthLocalForm {
  kWindows = 1,  // in the window around each pixel, for the residual at that pixel
  kPatch = 2,    // in one rectangle
};

struct PixelBox {
  int x = 0, y = 0, width = 0, height = 0;
};

// The prior D is known up to scale and shift, so the rendered depth Dhat = depth / alpha is
// compared after a fit a Dhat + b by least squares, through which no gradient passes. Pixels count
// where alpha > min_alpha, min_prior <= D <= max_prior and nothing is ignored. Loss:
//   view_weight * mean |a Dhat + b - D| over the pixels that count, with one fit for all of them,
//   local_weight * the same with a fit of its own for each window, or over the patch with one fit.
// A window of the wrong sign, or a patch that carries no fit, has no gradient. A view that carries
// no fit - few pixels, next to no spread of Dhat, a <= 0 - is skipped: all gradients and sums are 0
// but kDepthSkipped, which is 1.
struct DepthLossArgs {
  int width = 0;
  int height = 0;
  DeviceSpan<const float> alpha;          // [H, W] as Render gives it
  DeviceSpan<const float> depth;          // [H, W] likewise: of 1 / z for a disparity
  DeviceSpan<const float> prior;          // [H, W] NaN: unknown
  DeviceSpan<const uint8_t> ignore = {};  // [H, W] non-zero: leave the pixel out; may be empty
  float min_alpha = 0.5f;
  float min_prior = 0, max_prior = 1;  // what lies outside is an outlier
  float view_weight = 0, local_weight = 0;
  DepthLocalForm local_form = DepthLocalForm::kWindows;
  int window_radius = 0;         // pixels: windows are 2 radius + 1 a side, cut off at the border
  PixelBox patch = {};           // inside the image
  DeviceSpan<float> alpha_grad;  // [H, W]
  DeviceSpan<float> depth_grad;  // [H, W] of the sum, not of Dhat
  DeviceSpan<double> sums;       // [kNumDepthLossSums]
};
enum DepthLossSum {
  kSumDepthView,    // weighted: this view's part of the loss
  kSumDepthLocal,   // likewise
  kSumDepthPixels,  // that count
  kDepthScale,      // a and b
  kDepthShift,
  kDepthSkipped,
  kNumDepthLossSums
};

}  // namespace pepeseg
