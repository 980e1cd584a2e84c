#pragma once

#include <cstdint>

#include "kernels/buffer.h"

// Arguments of the comparison of rendered depth with a monocular prior in stage one (METHOD.md
// section 1, "Depth"). H and W are the height and width of the view in pixels.

namespace pepeseg {

// Where the prior is fitted besides the whole view.
enum class DepthLocalForm {
  kWindows = 1,  // in a window around each pixel, for the residual at that pixel
  kPatch = 2,    // in one rectangle, for the residuals in it
};

// A rectangle of pixels: columns x to x + width - 1, rows y to y + height - 1.
struct PixelBox {
  int x = 0, y = 0, width = 0, height = 0;
};

// Loss of rendered depth against a prior D that is known up to scale and shift (MiDaS alignment,
// kernels/math/depth.h). The rendered depth Dhat = depth / alpha is compared after a least-squares
// fit a Dhat + b, through which no gradient passes. A pixel counts where alpha > min_alpha,
// min_prior <= D <= max_prior and `ignore` is 0. The loss is the sum of
//   view_weight * mean |a Dhat + b - D| over the pixels that count, with one fit for all of them,
//   local_weight * the same mean with a fit of its own for each window, or over the rectangle with
//   one fit.
// In a window whose fit has a <= 0, and in a rectangle that carries no fit, the gradient is 0.
//
// A view carries no fit when few pixels count, Dhat has next to no spread, or a <= 0. It is then
// skipped: all gradients and sums are 0 except kDepthSkipped, which is 1.
struct DepthLossArgs {
  int width = 0;                          // pixels
  int height = 0;                         // pixels
  DeviceSpan<const float> alpha;          // [H, W] as written by Render
  DeviceSpan<const float> depth;          // [H, W] as written by Render; a sum of 1 / z if D is
                                          // a disparity
  DeviceSpan<const float> prior;          // [H, W] D, any unit; NaN: unknown
  DeviceSpan<const uint8_t> ignore = {};  // [H, W] non-zero: ignore the pixel; empty: none
  float min_alpha = 0.5f;                 // [0, 1)
  float min_prior = 0, max_prior = 1;     // in the unit of D; values outside are outliers
  float view_weight = 0, local_weight = 0;
  DepthLocalForm local_form = DepthLocalForm::kWindows;
  int window_radius = 0;  // pixels; windows have 2 radius + 1 pixels a side, cut at the border
  PixelBox patch = {};    // the rectangle of kPatch, inside the image
  DeviceSpan<float> alpha_grad;  // [H, W] d loss / d alpha
  DeviceSpan<float> depth_grad;  // [H, W] d loss / d depth: with respect to the sum, not to Dhat
  DeviceSpan<double> sums;       // [kNumDepthLossSums]
};
enum DepthLossSum {
  kSumDepthView,    // part of the loss from the whole view, weighted
  kSumDepthLocal,   // part of the loss from windows or the rectangle, weighted
  kSumDepthPixels,  // number of pixels that count
  kDepthScale,      // a of the whole view
  kDepthShift,      // b of the whole view
  kDepthSkipped,    // 1: the view carries no fit; else 0
  kNumDepthLossSums
};

}  // namespace pepeseg
