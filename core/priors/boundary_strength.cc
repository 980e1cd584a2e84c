#include "core/priors/boundary_strength.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace pepeseg {
namespace {

struct Neighbourhood {
  double sigma;  // of the blur, pixels
  int offset;    // of its centres from the pixel
  float weight;
};
constexpr Neighbourhood kNeighbourhoods[] = {{1.2, 2, 0.4f}, {3.0, 4, 0.6f}};
constexpr int kDirections[][2] = {{2, 0}, {2, 1},  {1, 1},  {1, 2},
                                  {0, 2}, {-1, 2}, {-1, 1}, {-2, 1}};
constexpr int kNumDirections = 8;
constexpr int kMargin = 5;

// One row of (a - b)^2 / (a + b), added to `sum`.
void AddChiSquared(const float* a, const float* b, int count, float weight, float* sum) {
  for (int i = 0; i < count; ++i) {
    const float difference = a[i] - b[i];
    sum[i] += weight * difference * difference / (a[i] + b[i] + 1e-6f);
  }
}

// The shift nearest to `offset` pixels in a direction.
cv::Point Shift(int direction, int offset) {
  const double dx = kDirections[direction][0], dy = kDirections[direction][1];
  const double length = std::hypot(dx, dy);
  return {static_cast<int>(std::lround(dx / length * offset)),
          static_cast<int>(std::lround(dy / length * offset))};
}

// Adds the distances of one bin's blurred values on both sides of each pixel to `sums`, by
// direction.
void AddDistances(const cv::Mat& bin, const Neighbourhood& about, float weight,
                  std::vector<cv::Mat>& sums) {
  cv::Mat blurred, padded;
  cv::GaussianBlur(bin, blurred, {}, about.sigma);
  cv::copyMakeBorder(blurred, padded, kMargin, kMargin, kMargin, kMargin, cv::BORDER_REPLICATE);
  for (int d = 0; d < kNumDirections; ++d) {
    const cv::Point shift = Shift(d, about.offset);
    for (int y = 0; y < bin.rows; ++y) {
      AddChiSquared(padded.ptr<float>(y + kMargin + shift.y) + kMargin + shift.x,
                    padded.ptr<float>(y + kMargin - shift.y) + kMargin - shift.x, bin.cols,
                    0.5f * weight * about.weight, sums[d].ptr<float>(y));
    }
  }
}

// How far a depth jumps at a pixel, from one side of it to the other. A slope is no jump.
float Jump(float before, float at, float after) {
  const float bend = std::abs(before + after - 2 * at) + std::abs(after - before);
  const float slope = 2 * std::min(std::abs(at - before), std::abs(after - at));
  return bend - slope;
}

}  // namespace

std::vector<float> BoundaryStrength(const PhotoChannels& channels) {
  const int width = channels.width, height = channels.height;
  std::vector<cv::Mat> sums;
  sums.reserve(kNumDirections);
  for (int d = 0; d < kNumDirections; ++d) sums.push_back(cv::Mat::zeros(height, width, CV_32F));
  for (const PhotoChannels::Group& group : channels.groups) {
    for (const cv::Mat& bin : group.bins) {
      for (const Neighbourhood& about : kNeighbourhoods) {
        AddDistances(bin, about, group.weight, sums);
      }
    }
  }
  cv::Mat strength = sums[0];
  for (int d = 1; d < kNumDirections; ++d) cv::max(strength, sums[d], strength);
  cv::sqrt(strength, strength);  // a distance
  return {strength.begin<float>(), strength.end<float>()};
}

std::vector<float> DepthStrength(const std::vector<float>& depth, int width, int height) {
  constexpr int kOffset = 2;
  constexpr float kFullJump = 0.1f;  // priors are mapped to [0, 1]
  std::vector<float> strength(depth.size());
  for (int y = kOffset; y + kOffset < height; ++y) {
    for (int x = kOffset; x + kOffset < width; ++x) {
      const int64_t pixel = int64_t{y} * width + x;
      for (int d = 0; d < kNumDirections; ++d) {
        const cv::Point shift = Shift(d, kOffset);
        const int64_t offset = int64_t{shift.y} * width + shift.x;
        const float jump = Jump(depth[pixel - offset], depth[pixel], depth[pixel + offset]);
        if (!std::isfinite(jump)) continue;
        strength[pixel] = std::max(strength[pixel], std::min(1.0f, jump / kFullJump));
      }
    }
  }
  return strength;
}

}  // namespace pepeseg
