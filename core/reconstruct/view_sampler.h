#pragma once

#include <random>
#include <vector>

namespace pepeseg {

// Indices in [0, count), shuffled without replacement: each comes once before any comes again.
class ViewSampler {
 public:
  explicit ViewSampler(int count) : count_(count) {}

  int Next(std::mt19937_64& random);

 private:
  int count_;
  std::vector<int> left_;  // of this round, taken from the back
};

}  // namespace pepeseg
