#pragma once

#include <vector>

namespace pepeseg {

// One float a pixel, row-major [height, width], the top row first.
struct FloatImage {
  int width = 0;
  int height = 0;
  std::vector<float> values;
};

}  // namespace pepeseg
