#include "core/priors/depth_edges.h"

#include <algorithm>
#include <cmath>

#include "opencv2/imgproc.hpp"

namespace pepeseg {
namespace {

// Of Sobel's sum, four times a step of the prior, in 255ths of its range: edges begin at a step of
// 4 % and go on where there is one of 2 %.
constexpr double kStrongEdge = 40, kWeakEdge = 20;
constexpr int kDilation = 5;  // pixels a side

}  // namespace

std::vector<uint8_t> DepthEdges(const View& view) {
  const int width = view.camera.width, height = view.camera.height;
  cv::Mat levels(height, width, CV_8U), edges, dilated;
  std::transform(
      view.depth.values.begin(), view.depth.values.end(), levels.begin<uint8_t>(), [](float value) {
        return std::isnan(value) ? uint8_t{0} : static_cast<uint8_t>(std::lround(255 * value));
      });
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
