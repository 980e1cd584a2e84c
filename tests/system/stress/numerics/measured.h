#pragma once

#include <string>

#include "kernels/backend.h"

// The measured values of kernels/NUMERICS.md, and the bounds that follow from them.
namespace pepeseg::testing {

enum class MeasureKind {
  kError,     // an error or a magnitude: at most three times the measured value
  kDecibels,  // a PSNR: at most 1.5 dB less (1.4 times the squared error); 58.5 if over 60 dB
  kShare,     // an IoU: at most 0.1 less
  kLoss,      // the loss of stage two, which is negative: at most a twentieth of it more
};

// Prints the value with its row of measured.inc, for the backend and the run (PEPESEG_STRESS).
// Fails the test if the value is not within the row's bound or not finite, or if there is no such
// row.
void ExpectAsMeasured(const Backend& backend, const std::string& row, double value);

}  // namespace pepeseg::testing
