#include "server/observe/self_probe.h"

#include <gtest/gtest.h>

#include <atomic>
#include <future>
#include <string>
#include <vector>

#include "absl/time/clock.h"
#include "tests/testing/eventually.h"

namespace pepeseg {
namespace {

constexpr SelfProbe::Pace kFast = {absl::Milliseconds(1), 3};

TEST(SelfProbe, ReportsOnceAfterThreeFailuresInARow) {
  // Two failures, a success, then failures only.
  std::atomic<int> num_tries = 0, num_reports = 0;
  std::promise<std::string> reported;
  const SelfProbe probe(
      [&] {
        return ++num_tries == 3 ? absl::OkStatus()
                                : absl::UnavailableError(std::to_string(num_tries));
      },
      kFast,
      [&](const absl::Status& why) {
        if (++num_reports == 1) reported.set_value(std::string(why.message()));
      });
  EXPECT_EQ(reported.get_future().get(), "6");
  absl::SleepFor(absl::Milliseconds(30));
  EXPECT_EQ(num_tries, 6);
  EXPECT_EQ(num_reports, 1);
}

TEST(SelfProbe, ReportsNothingWhileTheServerAnswers) {
  std::atomic<int> num_tries = 0, num_reports = 0;
  {
    const SelfProbe probe(
        [&] {
          ++num_tries;
          return absl::OkStatus();
        },
        kFast, [&](const absl::Status&) { ++num_reports; });
    EXPECT_TRUE(testing::Eventually([&] { return num_tries >= 10; }, absl::Seconds(30)));
  }
  EXPECT_EQ(num_reports, 0);
}

}  // namespace
}  // namespace pepeseg
