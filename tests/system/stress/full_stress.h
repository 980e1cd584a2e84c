#pragma once

#include <cstdlib>
#include <string>

namespace pepeseg::testing {

// Whether the whole of a run is wanted, as `make stress` does, or the short form of `make test`.
inline bool FullStress() {
  const char* stress = std::getenv("PEPESEG_STRESS");
  return stress != nullptr && std::string(stress) == "full";
}

}  // namespace pepeseg::testing
