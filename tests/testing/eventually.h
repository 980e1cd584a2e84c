#pragma once

#include <gtest/gtest.h>

#include <algorithm>

#include "absl/functional/function_ref.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"

namespace pepeseg::testing {

// Waits until `condition` is true, at most for `limit`, and reports whether it is:
// ASSERT_TRUE(Eventually([&] { return Count() == 2; })). Tests wait here instead of in loops.
[[nodiscard]] inline ::testing::AssertionResult Eventually(
    absl::FunctionRef<bool()> condition, absl::Duration limit = absl::Minutes(1)) {
  const absl::Time deadline = absl::Now() + limit;
  absl::Duration pause = absl::Milliseconds(1);
  while (!condition()) {
    if (absl::Now() >= deadline) {
      return ::testing::AssertionFailure() << "still false after " << absl::FormatDuration(limit);
    }
    absl::SleepFor(pause);
    pause = std::min(1.5 * pause, absl::Milliseconds(5));
  }
  return ::testing::AssertionSuccess();
}

}  // namespace pepeseg::testing
