#include "server/observe/exposition.h"

#include <gtest/gtest.h>

#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "tests/testing/http_get.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/time_limit.h"

namespace pepeseg {
namespace {

// Its HTTP server alone would look only every two seconds whether it is to stop.
TEST(Exposition, StopsAtOnce) {
  for (const char* listen : {"127.0.0.1:0", "localhost:0", "0.0.0.0:0"}) {
    auto exposition = Exposition::Start(listen);
    ASSERT_OK(exposition);
    // After an answer the server waits for the next connection.
    EXPECT_NE(HttpGet((*exposition)->port(), "/metrics"), "");
    const absl::Time start = absl::Now();
    exposition->reset();
    EXPECT_LT(absl::Now() - start, testing::TimeLimit(absl::Milliseconds(100))) << listen;
  }
}

}  // namespace
}  // namespace pepeseg
