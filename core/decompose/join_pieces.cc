#include "core/decompose/join_pieces.h"

#include <cassert>
#include <cmath>
#include <cstddef>
#include <numeric>

#include "kernels/ops/render.h"

namespace pepeseg {
namespace {

constexpr float kApart = -2;  // below any cosine

// Keeps the matrix of all cosines and the nearest piece of each piece, so that a join costs one row
// of the matrix, and another one for each piece whose nearest piece was one of the two.
class Joiner {
 public:
  explicit Joiner(std::span<const float> sums)
      : count_(sums.size() / kFeatureSize),
        sums_(sums.begin(), sums.end()),
        cosine_(count_ * count_, kApart),
        nearest_(count_),
        joined_to_(count_) {
    std::iota(joined_to_.begin(), joined_to_.end(), 0);
    for (size_t a = 0; a < count_; ++a) {
      for (size_t b = a + 1; b < count_; ++b) SetCosine(a, b, Cosine(a, b));
    }
    for (size_t a = 0; a < count_; ++a) FindNearest(a);
  }

  // Joins the closest two pieces. Returns false if no two have a cosine over `join_cosine`.
  bool JoinClosest(double join_cosine) {
    // Agglomerative clustering by the cosine of the means. The first of equal cosines is joined, so
    // that the result is fixed.
    size_t a = 0;
    for (size_t i = 1; i < count_; ++i) {
      if (NearestCosine(i) > NearestCosine(a)) a = i;
    }
    if (count_ == 0 || !(double{NearestCosine(a)} > join_cosine)) return false;
    Join(a, nearest_[a]);  // a is the lower of the two, because the search took the first maximum
    return true;
  }

  // Returns the new number of each piece.
  std::vector<int32_t> Numbers() const {
    std::vector<int32_t> numbers(count_);
    int32_t next = 0;
    for (size_t i = 0; i < count_; ++i) {  // pieces are joined to lower ones only
      numbers[i] = joined_to_[i] == i ? next++ : numbers[joined_to_[i]];
    }
    return numbers;
  }

 private:
  float Cosine(size_t a, size_t b) const {
    double ab = 0, aa = 0, bb = 0;
    for (int k = 0; k < kFeatureSize; ++k) {
      const double x = sums_[a * kFeatureSize + k], y = sums_[b * kFeatureSize + k];
      ab += x * y;
      aa += x * x;
      bb += y * y;
    }
    // A piece whose features cancel out has no direction and is never joined.
    return aa > 0 && bb > 0 ? static_cast<float>(ab / std::sqrt(aa * bb)) : kApart;
  }
  void SetCosine(size_t a, size_t b, float cosine) {
    cosine_[a * count_ + b] = cosine_[b * count_ + a] = cosine;
  }
  float NearestCosine(size_t a) const { return cosine_[a * count_ + nearest_[a]]; }
  // Sets the first piece with the largest cosine to a.
  void FindNearest(size_t a) {
    nearest_[a] = 0;
    for (size_t b = 1; b < count_; ++b) {
      if (cosine_[a * count_ + b] > NearestCosine(a)) nearest_[a] = b;
    }
  }
  // Joins b to a.
  void Join(size_t a, size_t b) {
    assert(a < b);
    for (int k = 0; k < kFeatureSize; ++k)
      sums_[a * kFeatureSize + k] += sums_[b * kFeatureSize + k];
    joined_to_[b] = a;
    for (size_t i = 0; i < count_; ++i) {
      SetCosine(b, i, kApart);
      if (i != a && joined_to_[i] == i) SetCosine(a, i, Cosine(a, i));
    }
    for (size_t i = 0; i < count_; ++i) {
      // A piece whose nearest was one of the two may now be nearer to any other; for the rest only
      // `a` can have come nearer.
      if (i == a || nearest_[i] == a || nearest_[i] == b) {
        FindNearest(i);
      } else if (cosine_[i * count_ + a] > NearestCosine(i)) {
        nearest_[i] = a;
      }
    }
  }

  size_t count_;
  std::vector<double> sums_;       // [count, 32]
  std::vector<float> cosine_;      // [count, count]; kApart with itself and with joined pieces
  std::vector<size_t> nearest_;    // [count] see FindNearest
  std::vector<size_t> joined_to_;  // [count] the lower piece that it was joined to; itself: none
};

}  // namespace

std::vector<int32_t> JoinPieces(std::span<const float> sums, double join_cosine) {
  assert(sums.size() % kFeatureSize == 0);
  Joiner joiner(sums);
  while (joiner.JoinClosest(join_cosine)) {
  }
  return joiner.Numbers();
}

}  // namespace pepeseg
