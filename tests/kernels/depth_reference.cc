#include "tests/kernels/depth_reference.h"

#include <algorithm>
#include <cmath>

namespace pepeseg {
namespace {

constexpr double kClose = 2e-6;  // residuals below it are close calls

// d = scale x + shift.
struct Line {
  double scale = 0, shift = 0;
  bool found = false;
};

// Statistics of the pixels of a box; variance is that of x.
struct Fit {
  double n = 0, mean_x = 0, mean_d = 0, variance = 0, covariance = 0;
};

// One evaluation of the loss; the gradients accumulate in out_.
class Comparison {
 public:
  explicit Comparison(const DepthImages& images) : images_(images), o_(images.options) {}

  ReferenceDepthLoss Compute() {
    const int num_pixels = images_.width * images_.height;
    out_.alpha_grad.assign(num_pixels, 0);
    out_.depth_grad.assign(num_pixels, 0);
    out_.close_call.assign(num_pixels, 0);
    const PixelBox all = {0, 0, images_.width, images_.height};
    const Fit fit = FitOf(all);
    const Line line = LineOf(fit);
    out_.skipped = !line.found;
    if (out_.skipped) return out_;
    out_.num_pixels = fit.n;
    AddBox(all, line, o_.view_weight / fit.n, &out_.view);
    if (o_.local_form == DepthLocalForm::kPatch) {
      const Fit of_patch = FitOf(o_.patch);
      const Line local = LineOf(of_patch);
      if (local.found) AddBox(o_.patch, local, o_.local_weight / of_patch.n, &out_.local);
    } else {
      AddWindows(fit);
    }
    return out_;
  }

 private:
  bool Counts(int x, int y) const {
    const int i = y * images_.width + x;
    const float d = images_.prior[i];
    if (std::isnan(d) || d < o_.min_prior || d > o_.max_prior) return false;
    if (!images_.ignore.empty() && images_.ignore[i] != 0) return false;
    return images_.alpha[i] > o_.min_alpha;
  }
  // Rendered depth and prior of a pixel.
  double X(int x, int y) const {
    const int i = y * images_.width + x;
    return double{images_.depth[i]} / images_.alpha[i];
  }
  double D(int x, int y) const { return images_.prior[y * images_.width + x]; }

  // Calls visit(x, y) for the pixels of the box that are in the image and count.
  template <class Visit>
  void ForEach(const PixelBox& box, Visit visit) const {
    for (int y = std::max(0, box.y); y < std::min(images_.height, box.y + box.height); ++y) {
      for (int x = std::max(0, box.x); x < std::min(images_.width, box.x + box.width); ++x) {
        if (Counts(x, y)) visit(x, y);
      }
    }
  }

  // In two passes, so that the variance does not cancel.
  Fit FitOf(const PixelBox& box) const {
    Fit fit;
    ForEach(box, [&](int x, int y) { ++fit.n, fit.mean_x += X(x, y), fit.mean_d += D(x, y); });
    if (fit.n == 0) return fit;
    fit.mean_x /= fit.n;
    fit.mean_d /= fit.n;
    ForEach(box, [&](int x, int y) {
      const double from_mean = X(x, y) - fit.mean_x;
      fit.variance += from_mean * from_mean / fit.n;
      fit.covariance += from_mean * (D(x, y) - fit.mean_d) / fit.n;
    });
    return fit;
  }

  // The line of a fit, unless the box carries none: few pixels, little spread, or the wrong sign.
  static Line LineOf(const Fit& fit) {
    if (fit.n < 32 || std::sqrt(fit.variance) <= 1e-3 * fit.mean_x || fit.covariance <= 0) {
      return {};
    }
    const double scale = fit.covariance / fit.variance;
    return {scale, fit.mean_d - scale * fit.mean_x, true};
  }

  // Adds weight * |residual| of one pixel and its gradients; none goes through the line.
  void AddPixel(int x, int y, const Line& line, double weight, double* loss) {
    const int i = y * images_.width + x;
    const double residual = line.scale * X(x, y) + line.shift - D(x, y);
    *loss += weight * std::abs(residual);
    if (std::abs(residual) < kClose) out_.close_call[i] = 1;
    const double grad = residual == 0 ? 0 : std::copysign(weight * line.scale, residual);
    out_.depth_grad[i] += grad / images_.alpha[i];
    out_.alpha_grad[i] -= grad * images_.depth[i] / images_.alpha[i] / images_.alpha[i];
  }

  void AddBox(const PixelBox& box, const Line& line, double weight, double* loss) {
    ForEach(box, [&](int x, int y) { AddPixel(x, y, line, weight, loss); });
  }

  // Compares each pixel with the line of the window about it. A negative scale counts as 0.
  void AddWindows(const Fit& view) {
    const int side = 2 * o_.window_radius + 1;
    ForEach({0, 0, images_.width, images_.height}, [&](int x, int y) {
      const Fit fit = FitOf({x - o_.window_radius, y - o_.window_radius, side, side});
      const double scale = std::max(0.0, fit.covariance / (fit.variance + 1e-4 * view.variance));
      AddPixel(x, y, {scale, fit.mean_d - scale * fit.mean_x, true}, o_.local_weight / view.n,
               &out_.local);
    });
  }

  const DepthImages& images_;
  const DepthLossArgs& o_;
  ReferenceDepthLoss out_;
};

}  // namespace

ReferenceDepthLoss ComputeReferenceDepthLoss(const DepthImages& images) {
  return Comparison(images).Compute();
}

}  // namespace pepeseg
