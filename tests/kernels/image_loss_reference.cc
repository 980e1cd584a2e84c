#include "tests/kernels/image_loss_reference.h"

#include <cmath>

#include "kernels/math/ssim.h"

namespace pepeseg {
namespace {

bool Counts(const LossImages& images, int x, int y) {
  return images.ignore.empty() || images.ignore[y * images.width + x] == 0;
}
double Target(const LossImages& images, int channel, int x, int y) {
  return images.target[(y * images.width + x) * 3 + channel] / 255.0;
}
// An ignored pixel shows the photograph.
double Color(const LossImages& images, int channel, int x, int y) {
  if (!Counts(images, x, y)) return Target(images, channel, x, y);
  return images.color[(channel * images.height + y) * images.width + x];
}

// Weight of the window, not from kernels/math: exp(-d^2 / (2 1.5^2)), normalised in two dimensions.
double WindowWeight(int dx, int dy) {
  double sum = 0;
  for (int k = -5; k <= 5; ++k) sum += std::exp(-k * k / 4.5);
  return std::exp(-(dx * dx + dy * dy) / 4.5) / (sum * sum);
}

// Calls fn(u, v, weight) for the pixels of the window about (x, y) that are in the image.
template <class Fn>
void ForEachInWindow(const LossImages& images, int x, int y, Fn&& fn) {
  for (int dy = -5; dy <= 5; ++dy) {
    for (int dx = -5; dx <= 5; ++dx) {
      const int u = x + dx, v = y + dy;
      if (u < 0 || v < 0 || u >= images.width || v >= images.height) continue;
      fn(u, v, WindowWeight(dx, dy));
    }
  }
}

// Weighted moments of the window about (x, y), with zeros outside the image.
SsimMoments<double> Moments(const LossImages& images, int channel, int x, int y) {
  SsimMoments<double> m = {0, 0, 0, 0};
  ForEachInWindow(images, x, y, [&](int u, int v, double weight) {
    const double a = Color(images, channel, u, v), b = Target(images, channel, u, v);
    m.x += weight * a;
    m.y += weight * b;
    m.sum_squares += weight * (a * a + b * b);
    m.product += weight * a * b;
  });
  return m;
}

// SSIM as written in the paper, with separate variances.
double WindowSsim(const SsimMoments<double>& m) {
  const double c1 = 1e-4, c2 = 9e-4;
  const double variances = m.sum_squares - m.x * m.x - m.y * m.y;
  const double covariance = m.product - m.x * m.y;
  return (2 * m.x * m.y + c1) * (2 * covariance + c2) /
         ((m.x * m.x + m.y * m.y + c1) * (variances + c2));
}

// Calls fn(channel, x, y) for all pixels that are not ignored.
template <class Fn>
void ForEachCounted(const LossImages& images, Fn&& fn) {
  for (int channel = 0; channel < 3; ++channel) {
    for (int y = 0; y < images.height; ++y) {
      for (int x = 0; x < images.width; ++x) {
        if (Counts(images, x, y)) fn(channel, x, y);
      }
    }
  }
}

}  // namespace

ReferenceLoss ComputeReferenceLoss(const LossImages& images) {
  ReferenceLoss loss;
  ForEachCounted(images, [&](int channel, int x, int y) {
    const double d = Color(images, channel, x, y) - Target(images, channel, x, y);
    loss.l1 += std::abs(d);
    loss.mse += d * d;
    loss.ssim += WindowSsim(Moments(images, channel, x, y));
    ++loss.num_pixel_channels;
  });
  loss.l1 /= loss.num_pixel_channels;
  loss.mse /= loss.num_pixel_channels;
  loss.ssim /= loss.num_pixel_channels;
  return loss;
}

std::vector<double> ComputeReferenceLossGradient(const LossImages& images, double ssim_weight) {
  std::vector<double> grad(images.color.size());
  double num = 0;
  ForEachCounted(images, [&](int, int, int) { ++num; });
  ForEachCounted(images, [&](int channel, int x, int y) {
    const auto at = [&](int u, int v) { return (channel * images.height + v) * images.width + u; };
    const double d = Color(images, channel, x, y) - Target(images, channel, x, y);
    grad[at(x, y)] += (1 - ssim_weight) / num * ((d > 0) - (d < 0));
    // The window about (x, y) moves with every pixel in it.
    const auto g = SsimVjp(Moments(images, channel, x, y), -ssim_weight / num);
    ForEachInWindow(images, x, y, [&](int u, int v, double w) {
      if (!Counts(images, u, v)) return;
      const SsimMomentsGrad<double> weighted = {w * g.x, w * g.sum_squares, w * g.product};
      grad[at(u, v)] +=
          SsimPixelVjp(weighted, Color(images, channel, u, v), Target(images, channel, u, v));
    });
  });
  return grad;
}

}  // namespace pepeseg
