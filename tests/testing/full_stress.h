#pragma once

#include <cstdlib>
#include <string>

namespace pepeseg::testing {

// Returns whether to do the full run of `make stress` (PEPESEG_STRESS=full), or the short one of
// `make test`.
inline bool FullStress() {
  const char* stress = std::getenv("PEPESEG_STRESS");
  return stress != nullptr && std::string(stress) == "full";
}

}  // namespace pepeseg::testing
