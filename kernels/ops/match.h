#pragma once

#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "kernels/buffer.h"

// Arguments of matching: the exact nearest neighbours of the descriptors of two photographs, under
// the tests of Lowe (2004, section 7.1). Descriptors are RootSIFT (Arandjelovic and Zisserman 2012)
// in bytes: vectors of length 512, about, so that a dot product over 512^2 is the cosine of the
// angle between two of them. Everything but the table of limits is integers, so that all backends
// and instruction sets find the same matches.

namespace pepeseg {

inline constexpr int kDescriptorBytes = 128;
// Dot product of two equal descriptors. Larger ones, by rounding, count as this.
inline constexpr int32_t kFullDot = 512 * 512;

// A descriptor of one block and its nearest neighbour in another.
struct DescriptorMatch {
  uint32_t first = 0, second = 0;  // indices within the blocks

  bool operator==(const DescriptorMatch&) const = default;
};

// Two blocks of descriptors that are compared.
struct BlockPair {
  int32_t first = 0, second = 0;
};

// Returns, by the dot product with the nearest neighbour, [kFullDot + 1], the largest one with the
// second nearest with which a match passes; -1: none does. A match passes if its angle is at most
// `max_angle` radians and less than `max_ratio` of the angle to the second nearest. Angles are
// floats, as in COLMAP 3.8. `max_ratio` <= 1, so that equally near neighbours never pass.
inline std::vector<int32_t> SecondDotLimits(float max_ratio, float max_angle) {
  std::vector<float> angle(kFullDot + 1);
  for (int32_t dot = 0; dot <= kFullDot; ++dot) {
    angle[dot] = std::acos(static_cast<float>(dot) * (1.0f / static_cast<float>(kFullDot)));
  }
  std::vector<int32_t> limits(kFullDot + 1, -1);
  // The limit falls with the dot product of the nearest, so one pass over both finds all.
  int32_t second = kFullDot;
  for (int32_t best = kFullDot; best > 0 && angle[best] <= max_angle; --best) {
    while (second >= 0 && !(angle[best] < max_ratio * angle[second])) --second;
    limits[best] = second;
  }
  return limits;
}

// Matches pairs of blocks. A block is the descriptors of one photograph, or some of them; a block
// without descriptors has no matches. Waits on the host.
struct MatchDescriptorsArgs {
  DeviceSpan<const uint8_t> descriptors;    // [n, 128], at a multiple of 16 bytes
  std::span<const int64_t> block_first;     // [blocks + 1] on the host: first descriptor of each
  std::span<const BlockPair> pairs;         // on the host, fewer than 65,536
  DeviceSpan<const int32_t> second_limits;  // [kFullDot + 1] of SecondDotLimits
  // True: a match must also pass from the second block to the first, and be the same one. False:
  // every descriptor of the first block that passes is a match.
  bool mutual = true;
  std::vector<int64_t>* pair_first = nullptr;  // out, [pairs + 1]: first match of each pair
  // Out: the matches of each pair, by ascending `first`. Without memory: unspecified.
  std::vector<DescriptorMatch>* matches = nullptr;
};

}  // namespace pepeseg
