#pragma once

#include <cstddef>
#include <cstdint>
#include <random>
#include <sstream>
#include <string>

#include "absl/status/status.h"

namespace pepeseg {

// The standard's distributions differ between libraries; these do not.

// Uniform in (low, high].
inline float DrawBetween(float low, float high, std::mt19937_64& random) {
  const double share = (static_cast<double>(random() >> 11) + 1) * 0x1p-53;
  return static_cast<float>(low + share * (double{high} - low));
}

// Uniform in [0, count); count is at most 2^32.
inline size_t DrawIndex(size_t count, std::mt19937_64& random) {
  return static_cast<size_t>((random() >> 32) * count >> 32);
}

// The engine as text, and back. DATA_LOSS: it is no such text.
inline std::string StateOf(const std::mt19937_64& random) {
  std::ostringstream text;
  text << random;
  return text.str();
}
inline absl::Status SetState(const std::string& text, std::mt19937_64& random) {
  std::istringstream in(text);
  std::mt19937_64 read;
  if (!(in >> read)) return absl::DataLossError("the state of the random numbers is damaged");
  random = read;
  return absl::OkStatus();
}

}  // namespace pepeseg
