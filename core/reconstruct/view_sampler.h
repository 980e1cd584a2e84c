#pragma once

#include <random>
#include <utility>
#include <vector>

namespace pepeseg {

// Draws indices in [0, count) without replacement: each comes once in a round, in random order,
// before the next round begins.
class ViewSampler {
 public:
  explicit ViewSampler(int count) : count_(count) {}

  int Next(std::mt19937_64& random);

  // Indices that this round has not returned yet; the next one is at the back.
  const std::vector<int>& left() const { return left_; }
  // Resumes the round with `left`: each in [0, count), none twice.
  void Restore(std::vector<int> left) { left_ = std::move(left); }

 private:
  int count_;
  std::vector<int> left_;
};

}  // namespace pepeseg
