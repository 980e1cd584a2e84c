#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "core/scene/capture.h"

namespace pepeseg {

// Returns the photograph with its longer side at most `max_extent` pixels, averaged over areas. A
// smaller photograph is returned as it is.
Image ShrunkPhoto(const Image& photo, int max_extent);

// Features by which regions of a photograph are compared: soft histograms of colour and texture.
// Each bin is an image [height, width] of floats; in each group, the bins of a pixel sum to 1.
struct PhotoChannels {
  struct Group {
    std::vector<cv::Mat> bins;
    float weight = 0;  // in distances between histograms; the weights sum to about 1
  };
  std::vector<Group> groups;  // CIELAB lightness, a and b, then texture
  int width = 0, height = 0;
};

// Computes the channels of an RGB photograph at its own size.
PhotoChannels ChannelsOf(const Image& photo);

}  // namespace pepeseg
