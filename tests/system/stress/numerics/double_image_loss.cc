#include "tests/system/stress/numerics/double_image_loss.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "kernels/math/ssim.h"

namespace pepeseg::testing {
namespace {

using Plane = std::vector<double>;

// Convolves with zeros beyond the border. It is its own transpose, since the taps are symmetric.
Plane Filter(const Plane& in, int side) {
  Plane rows(in.size()), out(in.size());
  const auto pass = [side](const Plane& from, Plane& to, int step, int across) {
    for (int line = 0; line < side; ++line) {
      for (int i = 0; i < side; ++i) {
        double sum = 0;
        const int first = std::max(0, i - kSsimRadius), last = std::min(side - 1, i + kSsimRadius);
        for (int k = first; k <= last; ++k) {
          sum += kSsimTaps[std::abs(k - i)] * from[line * across + k * step];
        }
        to[line * across + i * step] = sum;
      }
    }
  };
  pass(in, rows, 1, side);
  pass(rows, out, side, 1);
  return out;
}

template <class Fn>
Plane Made(size_t size, Fn&& at) {
  Plane out(size);
  for (size_t i = 0; i < size; ++i) out[i] = at(i);
  return out;
}

}  // namespace

DoubleLoss DoubleImageLoss(const std::vector<double>& color, const std::vector<uint8_t>& photo,
                           int side, double ssim_weight) {
  const size_t size = size_t(side) * side;
  const double each = 1.0 / static_cast<double>(3 * size);
  DoubleLoss out;
  out.color_grad.resize(3 * size);
  for (size_t channel = 0; channel < 3; ++channel) {
    const double* x = color.data() + channel * size;
    const auto y = [&](size_t i) { return photo[3 * i + channel] / 255.0; };
    const Plane mean_x = Filter(Made(size, [&](size_t i) { return x[i]; }), side);
    const Plane mean_y = Filter(Made(size, y), side);
    const Plane squares =
        Filter(Made(size, [&](size_t i) { return x[i] * x[i] + y(i) * y(i); }), side);
    const Plane product = Filter(Made(size, [&](size_t i) { return x[i] * y(i); }), side);
    Plane grad_x(size), grad_squares(size), grad_product(size);
    for (size_t i = 0; i < size; ++i) {
      const SsimMoments<double> m = {mean_x[i], mean_y[i], squares[i], product[i]};
      const double difference = x[i] - y(i);
      out.loss += each * ((1 - ssim_weight) * std::abs(difference) + ssim_weight * (1 - Ssim(m)));
      out.mse += each * difference * difference;
      const SsimMomentsGrad<double> g = SsimVjp(m, -ssim_weight * each);
      grad_x[i] = g.x;
      grad_squares[i] = g.sum_squares;
      grad_product[i] = g.product;
    }
    grad_x = Filter(grad_x, side);
    grad_squares = Filter(grad_squares, side);
    grad_product = Filter(grad_product, side);
    for (size_t i = 0; i < size; ++i) {
      const double sign = (x[i] > y(i)) - (x[i] < y(i));
      const SsimMomentsGrad<double> gathered = {grad_x[i], grad_squares[i], grad_product[i]};
      out.color_grad[channel * size + i] =
          (1 - ssim_weight) * each * sign + SsimPixelVjp(gathered, x[i], y(i));
    }
  }
  return out;
}

}  // namespace pepeseg::testing
