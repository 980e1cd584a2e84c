#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "core/scene/capture.h"

namespace pepeseg {

// What a photograph is told apart by: soft histograms, one plane [height, width] of floats a bin.
// A pixel has 1 in all in each group of bins.
struct PhotoChannels {
  struct Group {
    std::vector<cv::Mat> bins;
    float weight = 0;  // of the group, 1 in all
  };
  std::vector<Group> groups;  // lightness, two of colour (CIELAB), and of texture
  int width = 0, height = 0;

  int num_bins() const;
};
// `photo`: RGB.
PhotoChannels ChannelsOf(const Image& photo);

}  // namespace pepeseg
