#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

// Mean and standard deviation of the gradients around a pixel. The perception loss takes its
// thresholds from them (METHOD.md section 3, "Perception loss").
namespace pepeseg {

// Computes mean and standard deviation of the numbers added.
class Spread {
 public:
  void Add(float x) {
    ++count_;
    sum_ += x;
    squares_ += x * x;
  }
  // Returns mean + standard deviation; 0 if nothing was added.
  float OneAboveMean() const {
    if (count_ == 0) return 0;
    const float mean = sum_ / static_cast<float>(count_);
    return mean + std::sqrt(std::max(0.0f, squares_ / static_cast<float>(count_) - mean * mean));
  }

 private:
  int count_ = 0;
  float sum_ = 0, squares_ = 0;
};

// Sums of the gradients of an image and of their squares over any window, by summed area tables.
class WindowSums {
 public:
  // gradient(i): of pixel i, y * width + x; NaN: none.
  template <class Gradient>
  WindowSums(int width, int height, Gradient gradient)
      : width_(width), height_(height), sums_(size_t(width + 1) * (height + 1)) {
    for (int y = 0; y < height; ++y) {
      Sums row = {};
      for (int x = 0; x < width; ++x) {
        const double value = double{gradient(int64_t{y} * width + x)};
        if (!std::isnan(value)) row = {row.count + 1, row.sum + value, row.squares + value * value};
        const Sums& above = At(x + 1, y);
        At(x + 1, y + 1) = {above.count + row.count, above.sum + row.sum,
                            above.squares + row.squares};
      }
    }
  }

  // Returns mean + standard deviation in the square of 2 radius + 1 pixels around a pixel, cut at
  // the border; 0 where nothing is known.
  float OneAboveMean(int32_t pixel, int radius) const {
    const int x = pixel % width_, y = pixel / width_;
    const int left = std::max(0, x - radius), right = std::min(width_, x + radius + 1);
    const int top = std::max(0, y - radius), bottom = std::min(height_, y + radius + 1);
    const Sums &a = At(left, top), &b = At(right, top), &c = At(left, bottom),
               &d = At(right, bottom);
    const double count = d.count - b.count - c.count + a.count;
    if (count == 0) return 0;
    const double mean = (d.sum - b.sum - c.sum + a.sum) / count;
    const double squares = (d.squares - b.squares - c.squares + a.squares) / count;
    return static_cast<float>(mean + std::sqrt(std::max(0.0, squares - mean * mean)));
  }

 private:
  struct Sums {
    double count = 0, sum = 0, squares = 0;
  };
  Sums& At(int x, int y) { return sums_[size_t(y) * (width_ + 1) + x]; }
  const Sums& At(int x, int y) const { return sums_[size_t(y) * (width_ + 1) + x]; }

  int width_, height_;
  std::vector<Sums> sums_;  // [height + 1, width + 1] over the pixels above and on the left
};

// Returns the absolute gradient at a pixel, from the differences to the next pixel on the right and
// below. difference(a, b): of two pixels. At the last column and scanline the one before is taken.
template <class Difference>
float GradientAt(int64_t pixel, int width, int height, Difference difference) {
  const int64_t right = pixel % width + 1 < width ? 1 : (width > 1 ? -1 : 0);
  const int64_t below = pixel / width + 1 < height ? width : (height > 1 ? -width : 0);
  return std::hypot(difference(pixel, pixel + right), difference(pixel, pixel + below));
}

}  // namespace pepeseg
