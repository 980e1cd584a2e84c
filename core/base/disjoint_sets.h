#pragma once

#include <cstddef>
#include <cstdint>
#include <numeric>
#include <vector>

namespace pepeseg {

// Sets of the numbers from 0 to before `count`, each of which begins in a set of its own
// (union-find). The smallest member represents a set, so that results do not depend on the order of
// joins.
class DisjointSets {
 public:
  explicit DisjointSets(size_t count) : next_(count) { std::iota(next_.begin(), next_.end(), 0u); }
  // Returns the representative of the set of i. Halves the path on the way.
  uint32_t Find(uint32_t i) {
    while (next_[i] != i) i = next_[i] = next_[next_[i]];
    return i;
  }
  // Joins the sets of a and b.
  void Join(uint32_t a, uint32_t b) {
    a = Find(a), b = Find(b);
    if (a < b) next_[b] = a;
    if (b < a) next_[a] = b;
  }

 private:
  std::vector<uint32_t> next_;
};

}  // namespace pepeseg
