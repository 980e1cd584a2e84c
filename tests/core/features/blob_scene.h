#pragma once

#include <vector>

#include "core/scene/capture.h"
#include "core/scene/gaussians.h"

namespace pepeseg::testing {

inline constexpr int kBlobViewSize = 96;  // pixels, width and height of each view

// A round Gaussian with a standard deviation of 5.3 pixels.
struct Blob {
  double x, y;     // pixels of its view
  bool is_masked;  // a square of 16 x 16 pixels around it is a mask
};

// Blobs in front of training views, each of which shows its own blobs alone. The rest of a view is
// empty. Gaussians are in the order of the blobs.
struct BlobScene {
  explicit BlobScene(const std::vector<std::vector<Blob>>& blobs_by_view);

  Capture capture;
  Gaussians gaussians;
};

}  // namespace pepeseg::testing
