#include "core/reconstruct/view_sampler.h"

#include <algorithm>
#include <numeric>

namespace pepeseg {

int ViewSampler::Next(std::mt19937_64& random) {
  if (left_.empty()) {
    left_.resize(count_);
    std::iota(left_.begin(), left_.end(), 0);
    std::shuffle(left_.begin(), left_.end(), random);
  }
  const int next = left_.back();
  left_.pop_back();
  return next;
}

}  // namespace pepeseg
