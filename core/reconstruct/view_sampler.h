#pragma once

#include <random>
#include <utility>
#include <vector>

namespace pepeseg {

// Indices in [0, count), shuffled without replacement: each comes once before any comes again.
class ViewSampler {
 public:
  explicit ViewSampler(int count) : count_(count) {}

  int Next(std::mt19937_64& random);

  // What this round has not given yet, the next one at the back.
  const std::vector<int>& left() const { return left_; }
  // Goes on with what `left` says: each in [0, count), none twice.
  void Restore(std::vector<int> left) { left_ = std::move(left); }

 private:
  int count_;
  std::vector<int> left_;  // of this round, taken from the back
};

}  // namespace pepeseg
