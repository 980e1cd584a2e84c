#pragma once

#include <vector>

namespace pepeseg::client::cli {

// A number over several models, such as one mIoU for each seed.
struct Spread {
  int count = 0;
  double mean = 0;
  double deviation = 0;  // of the sample, by count - 1; 0 for fewer than two values
  double least = 0, most = 0;
};
// Returns the spread of the values, zeros if there are none.
Spread SpreadOf(const std::vector<double>& values);

}  // namespace pepeseg::client::cli
