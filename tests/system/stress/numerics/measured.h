#pragma once

#include <string>

#include "kernels/backend.h"

// What kernels/NUMERICS.md says was measured, row by row, and the bound that follows from it.
namespace pepeseg::testing {

enum class MeasureKind {
  kError,     // an error or a magnitude: at most three times what was measured
  kDecibels,  // a PSNR: at most 1.5 dB less, which is 1.4 times the squared error; over 60 dB, 58.5
  kShare,     // an IoU: at most 0.1 less
  kLoss,      // the loss of stage two, which is negative: at most a twentieth of itself more
};

// Prints the value beside its row of measured.cc, for the backend and the form (PEPESEG_STRESS)
// that run, and fails when it is beyond the row's bound, not finite, or has no row.
void ExpectAsMeasured(const Backend& backend, const std::string& row, double value);

}  // namespace pepeseg::testing
