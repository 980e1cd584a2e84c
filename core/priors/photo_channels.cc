#include "core/priors/photo_channels.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <utility>

namespace pepeseg {
namespace {

constexpr int kColorBins = 12;
constexpr int kNumGradientDirections = 6;  // over 180 degrees: opposite gradients count as one
constexpr float kNoise = 2;  // lightness change a pixel at which half of the weight has a direction
// Lightness has a small weight: shading and shadows change it within an object more than they
// change its colour.
constexpr float kLightnessWeight = 0.1f, kColorWeight = 0.42f, kTextureWeight = 0.06f;

std::vector<cv::Mat> Planes(int count, const cv::Size& size) {
  std::vector<cv::Mat> planes;
  planes.reserve(count);
  for (int i = 0; i < count; ++i) planes.push_back(cv::Mat::zeros(size, CV_32F));
  return planes;
}

// Returns a soft histogram of each pixel's value over [low, high]: the weight of 1 is split
// linearly between the two bins whose centres the value lies between. Values outside count as the
// ends.
std::vector<cv::Mat> SoftBins(const cv::Mat& values, float low, float high) {
  std::vector<cv::Mat> bins = Planes(kColorBins, values.size());
  const float per_bin = (high - low) / (kColorBins - 1);
  for (int y = 0; y < values.rows; ++y) {
    const float* row = values.ptr<float>(y);
    for (int x = 0; x < values.cols; ++x) {
      // Under kColorBins - 1, so that bin + 1 exists.
      const float at = std::clamp((row[x] - low) / per_bin, 0.0f, kColorBins - 1.001f);
      const int bin = static_cast<int>(at);
      const float share = at - static_cast<float>(bin);
      bins[bin].at<float>(y, x) = 1 - share;
      bins[bin + 1].at<float>(y, x) = share;
    }
  }
  return bins;
}

// Returns a soft histogram of the direction of each pixel's lightness gradient. With g its length,
// bin 0 gets kNoise / (g + kNoise): flat texture. The rest is split linearly between the two
// nearest directions, in bins 1 to kNumGradientDirections.
std::vector<cv::Mat> TextureBins(const cv::Mat& lightness) {
  cv::Mat dx, dy;
  // 1 / 8 makes Sobel's sum the change a pixel.
  cv::Sobel(lightness, dx, CV_32F, 1, 0, 3, 1.0 / 8);
  cv::Sobel(lightness, dy, CV_32F, 0, 1, 3, 1.0 / 8);
  std::vector<cv::Mat> bins = Planes(1 + kNumGradientDirections, lightness.size());
  for (int y = 0; y < lightness.rows; ++y) {
    for (int x = 0; x < lightness.cols; ++x) {
      const float gx = dx.at<float>(y, x), gy = dy.at<float>(y, x);
      const float size = std::sqrt(gx * gx + gy * gy);
      const float share = size / (size + kNoise);
      auto turn = static_cast<float>(std::atan2(gy, gx) / CV_PI);  // half turns, (-1, 1]
      if (turn < 0) turn += 1;
      const float at = turn * kNumGradientDirections;
      const int bin = static_cast<int>(at) % kNumGradientDirections;
      const float next = at - std::floor(at);
      bins[0].at<float>(y, x) = 1 - share;
      bins[1 + bin].at<float>(y, x) += share * (1 - next);
      bins[1 + (bin + 1) % kNumGradientDirections].at<float>(y, x) += share * next;
    }
  }
  return bins;
}

}  // namespace

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

PhotoChannels ChannelsOf(const Image& photo) {
  const cv::Mat rgb(photo.height, photo.width, CV_8UC3, const_cast<uint8_t*>(photo.pixels.data()));
  cv::Mat color, lab[3];
  rgb.convertTo(color, CV_32F, 1.0 / 255);
  // From floats in [0, 1] OpenCV gives L in [0, 100], and a and b in about [-127, 127].
  cv::cvtColor(color, color, cv::COLOR_RGB2Lab);
  cv::GaussianBlur(color, color, {}, 0.8);
  cv::split(color, lab);
  PhotoChannels channels;
  channels.width = photo.width;
  channels.height = photo.height;
  channels.groups = {{SoftBins(lab[0], 0, 100), kLightnessWeight},
                     {SoftBins(lab[1], -60, 60), kColorWeight},
                     {SoftBins(lab[2], -60, 60), kColorWeight},
                     {TextureBins(lab[0]), kTextureWeight}};
  return channels;
}

}  // namespace pepeseg
