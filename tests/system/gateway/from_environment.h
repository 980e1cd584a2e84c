#pragma once

#include <cstdlib>

#include "absl/strings/numbers.h"

namespace pepeseg::testing {

// Returns the number in an environment variable, by which a stress test can be scaled.
inline double FromEnvironment(const char* name, double otherwise) {
  double value = 0;
  const char* text = std::getenv(name);
  return text != nullptr && absl::SimpleAtod(text, &value) ? value : otherwise;
}

}  // namespace pepeseg::testing
