#pragma once

#include <cstdint>

#include "kernels/buffer.h"
#include "kernels/gaussian_planes.h"
#include "kernels/render_scratch.h"

// Arguments of the pipeline steps of rendering and of stage one: const inputs first, outputs last.
// Images are planar float [channels, height, width] where the backend writes them, and interleaved
// u8 [height, width, channels] where they come from photographs.

namespace pepeseg {

// A pinhole view. OpenCV axes: x right, y down, z forward; pixel centres at integer + 0.5.
struct PinholeView {
  int width = 0;
  int height = 0;
  float fx = 0, fy = 0, cx = 0, cy = 0;  // pixels
  float cam_from_world[12] = {};         // row-major [3, 4], a rigid transform
};

// kernels/math/blend.h holds the constants of rasterisation (METHOD.md section 1).
struct RenderArgs {
  ConstGaussianPlanes gaussians;
  PinholeView view;
  float near_plane = 0.01f;  // scene units: nearer Gaussians are culled
  int active_sh_degree = 0;  // <= gaussians.sh_degree
  float background[3] = {0, 0, 0};
  RenderScratch* scratch = nullptr;
  DeviceSpan<float> color;       // [3, H, W]
  DeviceSpan<float> alpha = {};  // [H, W] accumulated alpha, 1 - T; may be empty
  DeviceSpan<float> depth = {};  // [H, W] sum of weight * z, not normalised; may be empty
  bool inverse_depth = false;    // `depth` is the sum of weight / z; nothing else changes
  bool for_backward = true;      // else RenderBackward fails: what it reads need not be kept
  // 0: the host waits until the (Gaussian, tile) entries are counted and makes room for them. More:
  // it waits for nothing (so that a step can be a graph) and takes room for so many entries. Where
  // that is too few the render is void: the images are background, RenderBackward and Update with
  // the scratch change nothing and counters[kNumVoidRenders] goes up. The caller reads the counters
  // when it suits it and repeats what was void, with 0. The sizes of the scratch's buffers are then
  // bounds: the counters hold the numbers. The CPU backend always makes room.
  int64_t entry_room = 0;
};

// Loss of one view: (1 - ssim_weight) * L1 + ssim_weight * (1 - SSIM), means over the pixels that
// count and 3 channels. SSIM: 11x11 Gaussian window, sigma 1.5, zero padding at the border,
// C1 = 0.01^2, C2 = 0.03^2.
struct ImageLossArgs {
  int width = 0;
  int height = 0;
  DeviceSpan<const float> color;          // [3, H, W] rendered
  DeviceSpan<const uint8_t> target;       // [H, W, 3] photograph
  DeviceSpan<const uint8_t> ignore = {};  // [H, W] non-zero: leave the pixel out; may be empty
  float ssim_weight = 0.2f;
  DeviceSpan<float> color_grad = {};  // [3, H, W]; may be empty: evaluate only
  DeviceSpan<double> sums;            // [kNumImageLossSums]
};
enum ImageLossSum { kSumL1, kSumSsim, kSumSquared, kSumPixelChannels, kNumImageLossSums };
// So L1 = sums[kSumL1] / sums[kSumPixelChannels], SSIM and MSE likewise. An ignored pixel shows the
// photograph in both images before the windows are taken and is left out of all sums: it neither
// pulls nor leaks, and its gradient is 0. All pixels ignored: all sums and gradients are 0.

// After Render with the same gaussians, view and scratch. Writes scratch->visible_grad.
struct RenderBackwardArgs {
  PinholeView view;
  float background[3] = {0, 0, 0};
  DeviceSpan<const float> color_grad;       // [3, H, W]
  DeviceSpan<const float> alpha_grad = {};  // [H, W]; may be empty
  DeviceSpan<const float> depth_grad = {};  // [H, W] of what Render blended; may be empty
  RenderScratch* scratch = nullptr;
};

// Projection backward: from scratch->visible_grad to the gradients of the parameters.
struct ProjectBackwardArgs {
  ConstGaussianPlanes gaussians;
  PinholeView view;
  int active_sh_degree = 0;
  RenderScratch* scratch = nullptr;
  GaussianPlanes grad;  // all rows written; zero where a Gaussian is not visible
};

struct LearningRates {
  float mean = 0, log_scale = 0, rotation = 0, opacity = 0, sh_dc = 0, sh_rest = 0;
};

// Per-Gaussian statistics for density control, accumulated over steps. Any span may be empty.
struct DensityStats {
  DeviceSpan<float> mean2d_grad_sum;  // [N] |d loss / d mean2d| in NDC units: x by W/2, y by H/2
  DeviceSpan<int32_t> num_visible;    // [N] views in which the Gaussian touched a tile
  DeviceSpan<float> max_radius;       // [N] largest 3-sigma radius seen, pixels
};

// Projection backward fused with Adam (Kingma & Ba 2015), one pass over the Gaussians. A Gaussian
// that is not visible gets the gradient 0 and still moves by its moments, as dense Adam does. The
// step count is per Gaussian. Rows with a non-finite gradient are skipped and counted. SH
// coefficients beyond the active degree are left alone.
struct UpdateArgs {
  PinholeView view;
  int active_sh_degree = 0;
  LearningRates learning_rates;
  float beta1 = 0.9f, beta2 = 0.999f, epsilon = 1e-15f;
  float min_log_scale = 0, max_log_scale = 0;  // kept within, when max > min
  RenderScratch* scratch = nullptr;
  GaussianPlanes gaussians;         // in and out
  GaussianPlanes moment1, moment2;  // in and out
  DeviceSpan<int32_t> num_steps;    // [N] in and out
  DensityStats stats;               // in and out
};

// The rows of the blend matrix for chosen pixels, after Render with the same scratch: pixel p's
// colour (or feature) is the sum over its row of weight * value[Gaussian]. Exact: same order, same
// thresholds as Render.
struct CaptureRowsArgs {
  DeviceSpan<const int32_t> pixels;  // [S] y * width + x, in [0, H * W)
  RenderScratch* scratch = nullptr;
  Buffer<int32_t>* row_first = nullptr;       // [S + 1], sized by the op
  Buffer<int32_t>* entry_gaussian = nullptr;  // [entries], sized by the op
  Buffer<float>* entry_weight = nullptr;      // [entries], a_i T_i, sized by the op
  DeviceSpan<float> pixel_alpha = {};         // [S] sum of the row; may be empty
  DeviceSpan<float> pixel_depth = {};         // [S] sum of weight * z, not normalised; may be empty
};

inline constexpr int kFeatureSize = 32;

// IEEE binary16 as stored; conversion is the backend's business.
struct Half {
  uint16_t bits;
};

// A feature map of a view, after Render with the same scratch.
struct RenderFeaturesArgs {
  DeviceSpan<const float> features;  // [N, 32]
  RenderScratch* scratch = nullptr;
  // [H * W, 32] sum of weight * feature; with confidences the weights are shared out by them:
  // sum(weight) * sum(weight * confidence * feature) / sum(weight * confidence).
  DeviceSpan<Half> map;
  DeviceSpan<const float> confidence = {};  // [N] over 0; may be empty
};

}  // namespace pepeseg
