#include "core/formats/picture.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "opencv2/imgproc.hpp"

namespace pepeseg {
namespace {

// Returns a view of the image's pixels.
cv::Mat PixelsOf(Image& image) {
  return {image.height, image.width, CV_8UC(image.channels), image.pixels.data()};
}

Image Blank(int width, int height, int channels) {
  Image image{width, height, channels, {}};
  image.pixels.resize(static_cast<size_t>(width) * height * channels);
  return image;
}

// Exchanges rows and columns.
Image Transposed(Image image) {
  Image result = Blank(image.height, image.width, image.channels);
  cv::Mat pixels = PixelsOf(result);
  cv::transpose(PixelsOf(image), pixels);
  return result;
}

}  // namespace

Image Upright(Image image, int orientation) {
  // EXIF 2.3, tag 0x0112: 5 to 8 are transposed first; then one axis, both or none is mirrored.
  const bool transposed = orientation >= 5 && orientation <= 8;
  if (transposed) image = Transposed(std::move(image));
  const bool mirrors_x =
      orientation == 2 || orientation == 3 || orientation == 6 || orientation == 7;
  const bool mirrors_y =
      orientation == 3 || orientation == 4 || orientation == 7 || orientation == 8;
  if (!mirrors_x && !mirrors_y) return image;
  cv::Mat pixels = PixelsOf(image);
  constexpr int kAroundX = 0, kAroundY = 1, kBoth = -1;  // codes of cv::flip
  cv::flip(pixels, pixels, mirrors_x && mirrors_y ? kBoth : mirrors_x ? kAroundY : kAroundX);
  return image;
}

Image ShrunkTo(Image image, int max_side) {
  // 0 or less: no limit.
  const int side = std::max(image.width, image.height);
  if (max_side <= 0 || side <= max_side) return image;
  const double scale = static_cast<double>(max_side) / side;
  // A narrow image keeps at least one pixel.
  const auto shrunk = [scale](int size) {
    return std::max(1, static_cast<int>(std::lround(size * scale)));
  };
  Image result = Blank(shrunk(image.width), shrunk(image.height), image.channels);
  cv::Mat pixels = PixelsOf(result);
  cv::resize(PixelsOf(image), pixels, pixels.size(), 0, 0, cv::INTER_AREA);
  return result;
}

}  // namespace pepeseg
