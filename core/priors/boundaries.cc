#include "core/priors/boundaries.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "core/priors/photo_channels.h"

namespace pepeseg {
namespace {

// One neighbourhood size. The blurred histograms at pixel + offset and pixel - offset are compared.
struct Neighbourhood {
  double sigma;  // standard deviation of the blur, pixels
  int offset;    // distance of either centre from the pixel, pixels
  float weight;  // share of the squared distance; the weights sum to 1
};
constexpr Neighbourhood kNeighbourhoods[] = {{1.2, 2, 0.4f}, {3.0, 4, 0.6f}};
// Eight directions over half a circle, as vectors of any length.
constexpr int kDirections[][2] = {{2, 0}, {2, 1},  {1, 1},  {1, 2},
                                  {0, 2}, {-1, 2}, {-1, 1}, {-2, 1}};
constexpr int kNumDirections = 8;
constexpr int kMargin = 5;  // pixels of padding; no offset exceeds it

// Adds weight * (a - b)^2 / (a + b) of each element to `sum`. The epsilon avoids 0 / 0.
void AddChiSquared(const float* a, const float* b, int count, float weight, float* sum) {
  for (int i = 0; i < count; ++i) {
    const float difference = a[i] - b[i];
    sum[i] += weight * difference * difference / (a[i] + b[i] + 1e-6f);
  }
}

// Returns the whole-pixel shift nearest to `offset` pixels along a direction.
cv::Point Shift(int direction, int offset) {
  const double dx = kDirections[direction][0], dy = kDirections[direction][1];
  const double length = std::hypot(dx, dy);
  return {static_cast<int>(std::lround(dx / length * offset)),
          static_cast<int>(std::lround(dy / length * offset))};
}

// Adds one bin's part of the chi-squared distance between the two sides of each pixel to `sums`,
// one image for each direction. The bin is blurred once; padding repeats the rim, so that the inner
// loop reads whole scanlines without bounds checks.
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

// Returns twice the difference between the two one-sided steps of the depth, in absolute value:
// 2 (max(|s|, |t|) - min(|s|, |t|)) with s = at - before and t = after - at, because
// |t - s| + |t + s| = 2 max(|s|, |t|). A step of height h gives 2 h, a slope gives 0. NaN where a
// depth is unknown.
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
  // Chi-squared distance of the histograms on both sides, 0.5 sum (a - b)^2 / (a + b), summed
  // over channels and sizes for each direction; the largest direction counts.
  for (const PhotoChannels::Group& group : channels.groups) {
    for (const cv::Mat& bin : group.bins) {
      for (const Neighbourhood& about : kNeighbourhoods) {
        AddDistances(bin, about, group.weight, sums);
      }
    }
  }
  cv::Mat strength = sums[0];
  for (int d = 1; d < kNumDirections; ++d) cv::max(strength, sums[d], strength);
  cv::sqrt(strength, strength);  // from the squared distance
  return {strength.begin<float>(), strength.end<float>()};
}

std::vector<float> DepthStrength(const std::vector<float>& depth, int width, int height) {
  constexpr int kOffset = 2;
  constexpr float kFullJump = 0.1f;  // a step of 0.05; see Jump
  std::vector<float> strength(depth.size());
  // The rim of kOffset pixels keeps a strength of 0: it has no neighbours on one side.
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

std::vector<uint8_t> DepthEdges(const View& view) {
  // Thresholds on Sobel's sum, which is four times a step of the prior in 255ths of its range: an
  // edge begins at a step of 4 % and continues along steps of 2 %.
  constexpr double kStrongEdge = 40, kWeakEdge = 20;
  constexpr int kDilation = 5;  // pixels a side
  const int width = view.camera.width, height = view.camera.height;
  cv::Mat levels(height, width, CV_8U), edges, dilated;
  std::transform(
      view.depth.values.begin(), view.depth.values.end(), levels.begin<uint8_t>(), [](float value) {
        return std::isnan(value) ? uint8_t{0} : static_cast<uint8_t>(std::lround(255 * value));
      });
  // Sobel of 3x3, L2 norm of the gradient.
  cv::Canny(levels, edges, kWeakEdge, kStrongEdge, 3, true);
  cv::dilate(edges, dilated, cv::Mat::ones(kDilation, kDilation, CV_8U));
  std::vector<uint8_t> out(view.depth.values.size());
  std::transform(dilated.begin<uint8_t>(), dilated.end<uint8_t>(), view.depth.values.begin(),
                 out.begin(), [](uint8_t edge, float value) {
                   return static_cast<uint8_t>(edge != 0 || std::isnan(value) ? 1 : 0);
                 });
  return out;
}

}  // namespace pepeseg
