#pragma once

#include <cstdint>

#include "kernels/math/hd.h"
#include "kernels/ops/match.h"

namespace pepeseg {

// The two largest dot products of a descriptor with those of another block.
struct NearestDots {
  int32_t best = 0, second = 0;
  int32_t index = -1;  // descriptor of `best`, the lowest of equal ones; -1: all products are 0
};

// Offers a dot product. Indices must ascend from call to call.
PEPESEG_HD void Offer(int32_t dot, int32_t index, NearestDots& nearest) {
  if (dot > nearest.best) {
    nearest.second = nearest.best;
    nearest.best = dot;
    nearest.index = index;
  } else if (dot > nearest.second) {
    nearest.second = dot;
  }
}

// Returns the nearest of two disjoint sets of descriptors together.
PEPESEG_HD NearestDots Merge(const NearestDots& a, const NearestDots& b) {
  const bool b_first = b.best > a.best || (b.best == a.best && b.index < a.index);
  const NearestDots& first = b_first ? b : a;
  const NearestDots& other = b_first ? a : b;
  const int32_t second = first.second > other.best ? first.second : other.best;
  return {first.best, second, first.index};
}

// Returns the index of the nearest descriptor, or -1 if the match does not pass.
PEPESEG_HD int32_t MatchOf(const NearestDots& nearest, const int32_t* second_limits) {
  if (nearest.index < 0) return -1;
  const int32_t best = nearest.best < kFullDot ? nearest.best : kFullDot;
  const int32_t second = nearest.second < kFullDot ? nearest.second : kFullDot;
  return second <= second_limits[best] ? nearest.index : -1;
}

}  // namespace pepeseg
