#include "tests/system/stress/numerics/measured.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <iterator>
#include <limits>

#include "tests/testing/full_stress.h"

namespace pepeseg::testing {
namespace {

constexpr auto kError = MeasureKind::kError;
constexpr auto kDecibels = MeasureKind::kDecibels;
constexpr auto kShare = MeasureKind::kShare;
constexpr auto kLoss = MeasureKind::kLoss;
// The row is not measured in this run.
constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

struct Row {
  const char* name;
  MeasureKind kind;
  double cpu, cpu_full, cuda, cuda_full;  // measured in the short run, and in the full one
};

// The values that this suite has measured. NUMERICS.md has a row for each.
constexpr Row kRows[] = {
#include "tests/system/stress/numerics/measured.inc"
};

// Returns the worst value that passes.
double BoundOf(MeasureKind kind, double measured) {
  switch (kind) {
    case MeasureKind::kError:
      return 3 * measured;
    case MeasureKind::kDecibels:
      return std::min(measured, 60.0) - 1.5;  // above 60 dB the error is that of 8 bits
    case MeasureKind::kShare:
      return measured - 0.1;
    case MeasureKind::kLoss:
      return measured + 0.05 * std::abs(measured);
  }
  return std::numeric_limits<double>::quiet_NaN();
}

}  // namespace

void ExpectAsMeasured(const Backend& backend, const std::string& row, double value) {
  const bool cuda = backend.name().starts_with("cuda");
  const char* form = FullStress() ? "full" : "short";
  const auto* at = std::find_if(std::begin(kRows), std::end(kRows),
                                [&row](const Row& each) { return each.name == row; });
  std::printf("MEASURED|%s|%s|%s|%.6g\n", row.c_str(), cuda ? "cuda" : "cpu", form, value);
  EXPECT_TRUE(std::isfinite(value)) << row;
  if (at == std::end(kRows)) {
    ADD_FAILURE() << "measured.inc has no row \"" << row << '"';
    return;
  }
  const double measured =
      cuda ? (FullStress() ? at->cuda_full : at->cuda) : (FullStress() ? at->cpu_full : at->cpu);
  const double bound = BoundOf(at->kind, measured);
  const bool more_is_worse = at->kind == MeasureKind::kError || at->kind == MeasureKind::kLoss;
  EXPECT_TRUE(more_is_worse ? value <= bound : value >= bound)
      << row << ": " << value << ", measured " << measured << ", bound " << bound;
}

}  // namespace pepeseg::testing
