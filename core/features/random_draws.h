#pragma once

#include <cstddef>
#include <cstdint>
#include <random>
#include <sstream>
#include <string>

#include "absl/status/status.h"

namespace pepeseg {

// Random numbers that are the same with every standard library. The engine is specified by the
// standard, its distributions are not.

// Returns a number that is uniform in (low, high].
inline float DrawBetween(float low, float high, std::mt19937_64& random) {
  const double share = (static_cast<double>(random() >> 11) + 1) * 0x1p-53;
  return static_cast<float>(low + share * (double{high} - low));
}

// Returns a number that is uniform in [0, count), but for a bias of at most count / 2^32. count is
// at most 2^32.
inline size_t DrawIndex(size_t count, std::mt19937_64& random) {
  return static_cast<size_t>((random() >> 32) * count >> 32);
}

// Returns the state of the engine as text, for checkpoints.
inline std::string StateOf(const std::mt19937_64& random) {
  std::ostringstream text;
  text << random;
  return text.str();
}
// Sets the engine to a state from StateOf. DATA_LOSS: `text` is not such a state; the engine is
// left as it was.
inline absl::Status SetState(const std::string& text, std::mt19937_64& random) {
  std::istringstream in(text);
  std::mt19937_64 read;
  if (!(in >> read)) return absl::DataLossError("the state of the random numbers is damaged");
  random = read;
  return absl::OkStatus();
}

}  // namespace pepeseg
