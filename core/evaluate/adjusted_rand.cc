#include "core/evaluate/adjusted_rand.h"

#include <cassert>
#include <map>
#include <utility>

namespace pepeseg {
namespace {

double Pairs(int64_t count) {
  return 0.5 * static_cast<double>(count) * static_cast<double>(count - 1);
}

// Of the sizes of a partition's pieces.
template <class Key>
double PairsInside(const std::map<Key, int64_t>& sizes) {
  double pairs = 0;
  for (const auto& [key, size] : sizes) pairs += Pairs(size);
  return pairs;
}

}  // namespace

double AdjustedRand(std::span<const int32_t> a, std::span<const int32_t> b) {
  assert(a.size() == b.size());
  std::map<int32_t, int64_t> of_a, of_b;
  std::map<std::pair<int32_t, int32_t>, int64_t> of_both;
  for (size_t i = 0; i < a.size(); ++i) {
    ++of_a[a[i]];
    ++of_b[b[i]];
    ++of_both[{a[i], b[i]}];
  }
  const double together = PairsInside(of_both);
  const double in_a = PairsInside(of_a), in_b = PairsInside(of_b);
  const double all = Pairs(static_cast<int64_t>(a.size()));
  const double by_chance = all > 0 ? in_a * in_b / all : 0;
  const double most = 0.5 * (in_a + in_b);
  return most == by_chance ? 1 : (together - by_chance) / (most - by_chance);
}

}  // namespace pepeseg
