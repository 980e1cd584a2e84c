#include "server/jobs/failed_photographs.h"

#include <gtest/gtest.h>

namespace pepeseg {
namespace {

TEST(FailedPhotographs, AreRememberedForTenMinutes) {
  FailedPhotographs failed;
  const absl::Time now = absl::FromUnixSeconds(1'000'000);
  const absl::Status error = absl::InvalidArgumentError("a.jpg: does not decode");
  EXPECT_TRUE(failed.Find("a", now).ok());
  failed.Remember("a", error, now);
  EXPECT_EQ(failed.Find("a", now + absl::Minutes(10)), error);
  EXPECT_TRUE(failed.Find("b", now).ok());
  EXPECT_TRUE(failed.Find("a", now + absl::Minutes(11)).ok());
}

}  // namespace
}  // namespace pepeseg
