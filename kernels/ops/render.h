#pragma once

#include <cstdint>
#include <span>

#include "kernels/buffer.h"
#include "kernels/gaussian_planes.h"
#include "kernels/half.h"
#include "kernels/render_scratch.h"

// Arguments of rendering and of the steps of stage one (METHOD.md section 1). Inputs come first,
// outputs last. An op borrows all spans, planes and scratches until it has run: on CUDA until the
// device has passed it. Unless a field says otherwise, an output is overwritten as a whole and
// overlaps no other argument.
//
// Images that a backend writes are planar float, [channels, H, W]. Photographs are interleaved u8,
// [H, W, channels]. H and W are the height and width of the view in pixels, N is the number of
// Gaussians.

namespace pepeseg {

// A pinhole view. OpenCV camera axes: x right, y down, z forward. Pixel centres lie at
// integer + 0.5.
struct PinholeView {
  int width = 0;                         // pixels
  int height = 0;                        // pixels
  float fx = 0, fy = 0, cx = 0, cy = 0;  // focal lengths and principal point, pixels
  float cam_from_world[12] = {};         // rigid transform, row-major [3, 4], scene units
};

// Dropout of Gaussians, see kernels/math/dropout.h.
struct Dropout {
  float share = 0;    // probability that a Gaussian is left out, in [0, 0.9]; 0: none is
  uint32_t seed = 0;  // another seed leaves out others
};

// Projects the Gaussians and blends them front to back, over black. kernels/math/blend.h holds the
// constants of rasterisation. Fills `scratch` for the ops that follow on the same render.
//
// Fails, without writing the images, when memory is short or when there are about 2^31 (Gaussian,
// tile) entries (the CPU stops at kMaxTileEntries).
struct RenderArgs {
  ConstGaussianPlanes gaussians;
  PinholeView view;
  float near_plane = 0.01f;          // scene units; a Gaussian with z <= near_plane is culled
  int active_sh_degree = 0;          // 0..gaussians.sh_degree; higher coefficients are not read
  Dropout dropout = {};              // for training; Update must be given the same
  RenderScratch* scratch = nullptr;  // in and out; buffers are reused between renders
  DeviceSpan<float> color;           // [3, H, W] rgb; photographs lie in [0, 1]
  DeviceSpan<float> alpha = {};      // [H, W] accumulated alpha, 1 - T; {}: not written
  DeviceSpan<float> depth = {};      // [H, W] sum of weight * z, not normalised; {}: not written
  bool inverse_depth = false;        // `depth` is the sum of weight / z; nothing else changes
  bool for_backward = true;          // false: keeps less, and RenderBackward fails on this scratch
  // Capacity in (Gaussian, tile) entries. 0: the host waits for the number of entries and makes
  // room for them. Above 0: the host waits for nothing, so that a step can be recorded
  // as a graph (Backend::Sequence), and the buffers of the scratch are sized for this capacity;
  // their sizes are then bounds, and the counters hold the numbers.
  //
  // If the capacity is too small the render overflows: the images are black, RenderBackward
  // and Update change nothing, and counters[kNumOverflowedRenders] rises by one. The caller reads
  // the counters when convenient and repeats an overflowed render with 0.
  //
  // The CPU backend ignores this field and always makes room.
  int64_t tile_entry_capacity = 0;
};

// Photometric loss of one view: (1 - ssim_weight) * L1 + ssim_weight * (1 - SSIM), each a mean over
// the pixels that count and 3 channels. SSIM (Wang et al. 2004) has an 11x11 Gaussian window with
// sigma 1.5, zero padding at the border, C1 = 0.01^2 and C2 = 0.03^2 (kernels/math/ssim.h).
//
// An ignored pixel shows the photograph in both images before the windows are taken, and is left
// out of all sums: it affects no other pixel, and its gradient is 0. With all pixels ignored, all
// sums and gradients are 0.
struct ImageLossArgs {
  int width = 0;                          // pixels
  int height = 0;                         // pixels
  DeviceSpan<const float> color;          // [3, H, W] rendered
  DeviceSpan<const uint8_t> target;       // [H, W, 3] photograph; 255 is 1
  DeviceSpan<const uint8_t> ignore = {};  // [H, W] non-zero: ignore the pixel; empty: none
  float ssim_weight = 0.2f;               // [0, 1]
  DeviceSpan<float> color_grad = {};      // [3, H, W] d loss / d color; empty: evaluate only
  DeviceSpan<double> sums;                // [kNumImageLossSums]
};
// Sums over the pixels that count and 3 channels. Divided by sums[kSumPixelChannels] they give L1,
// the mean SSIM and the mean squared error.
enum ImageLossSum {
  kSumL1,             // |color - target|
  kSumSsim,           // SSIM of the windows centred on them
  kSumSquared,        // (color - target)^2
  kSumPixelChannels,  // 1: three times the number of pixels that count
  kNumImageLossSums
};

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

// Backward pass of Render: writes d loss / d Splat to scratch->visible_grad. Runs after a Render of
// the same view with the same scratch. Fails with a fatal error unless that Render had
// `for_backward`. Changes nothing after an overflowed render.
struct RenderBackwardArgs {
  PinholeView view;
  DeviceSpan<const float> color_grad;       // [3, H, W]
  DeviceSpan<const float> alpha_grad = {};  // [H, W]; empty: 0
  // [H, W] with respect to the sum that Render wrote to `depth`, so only after a Render with
  // `depth`; empty: 0.
  DeviceSpan<const float> depth_grad = {};
  RenderScratch* scratch = nullptr;
};

// Adds the gradients of the visible splats' colours to sums of their Gaussians. Runs after a
// RenderBackward with the same scratch. Changes nothing after an overflowed render.
//
// The colour of a pixel is the sum of weight * colour over its splats. So where the gradient of a
// channel is 1 at some pixels and 0 at the others, that of a splat's colour is the sum of its blend
// weights at those pixels: up to three sets of pixels in one backward pass, and no blend rows.
struct AddWeightsArgs {
  const RenderScratch* scratch = nullptr;
  int num_planes = 1;      // 1..3: red, red and green, or all channels
  DeviceSpan<float> sums;  // [num_planes, N] in and out
};

// Learning rates of Adam by group of planes, in units of the stored parameters (gaussian_planes.h);
// that of the mean is in scene units.
struct LearningRates {
  float mean = 0, log_scale = 0, rotation = 0, opacity = 0, sh_dc = 0, sh_rest = 0;
};

// Statistics of each Gaussian for density control, accumulated by Update over the steps. A step
// counts where the Gaussian is visible and its gradient is finite. An empty span is not kept.
struct DensityStats {
  DeviceSpan<float> mean2d_grad_sum;  // [N] |d loss / d mean2d| in NDC units: x by W/2, y by H/2
  // [N] SplatGrad::squares. Large where a Gaussian is opaque, seen often, and wrong in opposite
  // ways at different pixels, so that mean2d_grad_sum cancels: one Gaussian cannot fit what it
  // covers.
  DeviceSpan<float> square_sum;
  DeviceSpan<int32_t> num_visible;  // [N] views in which the Gaussian touched a tile
  DeviceSpan<float> max_radius;     // [N] largest 3-sigma radius seen, pixels
};

// The gradient of one step of Adam: that of a view, after RenderBackward with the same scratch.
struct UpdateStep {
  PinholeView view;      // as given to Render
  Dropout dropout = {};  // as given to Render
  RenderScratch* scratch = nullptr;
};
inline constexpr int kMaxUpdateSteps = 8;

// Projection backward fused with steps of Adam (Kingma & Ba 2015), in one pass over the Gaussians.
// All gradients are taken at the Gaussians as they are before the first step. A step whose render
// overflowed changes nothing.
//
// A Gaussian that is not visible has the gradient 0 and still moves by its moments, as dense Adam
// does. Steps are counted for each Gaussian, so that the first step of a new one is no larger than
// another's. Where a gradient is not finite, the Gaussian's parameters, moments, step count and
// statistics stay as they are in that step, and counters[kNumSkippedGradientRows] counts it. SH
// coefficients beyond the active degree are left alone.
struct UpdateArgs {
  std::span<const UpdateStep> steps;  // 1 to kMaxUpdateSteps, each with a scratch of its own
  int active_sh_degree = 0;           // as given to all renders
  LearningRates learning_rates;
  float beta1 = 0.9f, beta2 = 0.999f, epsilon = 1e-15f;
  float min_log_scale = 0, max_log_scale = 0;  // bounds of log scales; max <= min: no bounds
  GaussianPlanes gaussians;                    // in and out
  GaussianPlanes moment1, moment2;             // in and out, of the same count and degree
  DeviceSpan<int32_t> num_steps;               // [N] in and out: steps of Adam so far
  DensityStats stats;                          // in and out
};

inline constexpr int kFeatureSize = 32;  // numbers in the feature of a Gaussian

// Feature map of a view. Runs after a Render with the same scratch, which need not be for backward.
struct RenderFeaturesArgs {
  DeviceSpan<const float> features;  // [N, 32]
  RenderScratch* scratch = nullptr;  // only read
  // [H * W, 32] sum of weight * feature. With confidences the weights are redistributed by them:
  // sum(weight) * sum(weight * confidence * feature) / sum(weight * confidence).
  DeviceSpan<Half> map;
  DeviceSpan<const float> confidence = {};  // [N] above 0; empty: all are 1
};

}  // namespace pepeseg
