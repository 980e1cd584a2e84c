#pragma once

#include <random>
#include <sstream>
#include <string>

#include "absl/status/status.h"

namespace pepeseg {

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
