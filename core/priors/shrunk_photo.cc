#include "core/priors/shrunk_photo.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace pepeseg {

Image ShrunkPhoto(const Image& photo, int max_extent) {
  const double factor =
      std::min(1.0, static_cast<double>(max_extent) / std::max(photo.width, photo.height));
  Image shrunk;
  shrunk.width = std::max(1, static_cast<int>(std::lround(photo.width * factor)));
  shrunk.height = std::max(1, static_cast<int>(std::lround(photo.height * factor)));
  shrunk.channels = photo.channels;
  const cv::Mat from(photo.height, photo.width, CV_8UC(photo.channels),
                     const_cast<uint8_t*>(photo.pixels.data()));
  cv::Mat to;
  cv::resize(from, to, {shrunk.width, shrunk.height}, 0, 0, cv::INTER_AREA);
  shrunk.pixels.assign(to.datastart, to.dataend);
  return shrunk;
}

}  // namespace pepeseg
