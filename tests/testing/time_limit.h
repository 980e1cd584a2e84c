#pragma once

#include "absl/time/time.h"
#include "tests/testing/full_stress.h"

namespace pepeseg::testing {

// Returns the time that something may take which takes less than `idle` on an idle machine: `idle`
// in `make stress`, ten times as much in `make test`, where other tests and compilers run.
inline absl::Duration TimeLimit(absl::Duration idle) { return FullStress() ? idle : 10 * idle; }

}  // namespace pepeseg::testing
