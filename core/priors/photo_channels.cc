#include "core/priors/photo_channels.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <utility>

namespace pepeseg {
namespace {

constexpr int kColorBins = 12;
constexpr int kNumGradientDirections = 6;  // of the gradient, modulo 180 degrees
constexpr float kNoise = 2;                // lightness; gradients below it have no direction
// Shading and shadows change the lightness within a thing more than its colour.
constexpr float kLightnessWeight = 0.1f, kColorWeight = 0.42f, kTextureWeight = 0.06f;

std::vector<cv::Mat> Planes(int count, const cv::Size& size) {
  std::vector<cv::Mat> planes;
  planes.reserve(count);
  for (int i = 0; i < count; ++i) planes.push_back(cv::Mat::zeros(size, CV_32F));
  return planes;
}

// Each value's 1 is shared by the two bins whose centres it lies between.
std::vector<cv::Mat> SoftBins(const cv::Mat& values, float low, float high) {
  std::vector<cv::Mat> bins = Planes(kColorBins, values.size());
  const float per_bin = (high - low) / (kColorBins - 1);
  for (int y = 0; y < values.rows; ++y) {
    const float* row = values.ptr<float>(y);
    for (int x = 0; x < values.cols; ++x) {
      const float at = std::clamp((row[x] - low) / per_bin, 0.0f, kColorBins - 1.001f);
      const int bin = static_cast<int>(at);
      const float share = at - static_cast<float>(bin);
      bins[bin].at<float>(y, x) = 1 - share;
      bins[bin + 1].at<float>(y, x) = share;
    }
  }
  return bins;
}

// Where the lightness changes, in which direction; the first bin has what does not change.
std::vector<cv::Mat> TextureBins(const cv::Mat& lightness) {
  cv::Mat dx, dy;
  cv::Sobel(lightness, dx, CV_32F, 1, 0, 3, 1.0 / 8);
  cv::Sobel(lightness, dy, CV_32F, 0, 1, 3, 1.0 / 8);
  std::vector<cv::Mat> bins = Planes(1 + kNumGradientDirections, lightness.size());
  for (int y = 0; y < lightness.rows; ++y) {
    for (int x = 0; x < lightness.cols; ++x) {
      const float gx = dx.at<float>(y, x), gy = dy.at<float>(y, x);
      const float size = std::sqrt(gx * gx + gy * gy);
      const float share = size / (size + kNoise);
      auto turn = static_cast<float>(std::atan2(gy, gx) / CV_PI);  // (-1, 1]
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

int PhotoChannels::num_bins() const {
  int num = 0;
  for (const Group& group : groups) num += static_cast<int>(group.bins.size());
  return num;
}

PhotoChannels ChannelsOf(const Image& photo) {
  const cv::Mat rgb(photo.height, photo.width, CV_8UC3, const_cast<uint8_t*>(photo.pixels.data()));
  cv::Mat color, lab[3];
  rgb.convertTo(color, CV_32F, 1.0 / 255);
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
