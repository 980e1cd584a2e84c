#include "server/observe/health_monitor.h"

#include <gtest/gtest.h>

#include <atomic>
#include <filesystem>
#include <future>
#include <limits>

#include "absl/time/clock.h"
#include "kernels/buffer.h"
#include "tests/testing/eventually.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

constexpr HealthMonitor::Pace kQuick = {absl::Milliseconds(5), absl::Milliseconds(100)};

// Records what is published, and waits for it.
class Published {
 public:
  HealthMonitor::Publish Callback() {
    return [this](const std::string& service, bool serving) {
      const std::lock_guard lock(mutex_);
      serving_[service] = serving;
    };
  }
  ::testing::AssertionResult Await(const std::string& service, bool serving) const {
    return testing::Eventually([&] { return Is(service, serving); }, absl::Seconds(10));
  }
  bool Is(const std::string& service, bool serving) const {
    const std::lock_guard lock(mutex_);
    const auto found = serving_.find(service);
    return found != serving_.end() && found->second == serving;
  }

 private:
  mutable std::mutex mutex_;
  std::map<std::string, bool> serving_;
};

TEST(HealthMonitor, RunsAProbeThatCannotHangWithoutAThread) {
  Published published;
  std::atomic<bool> works = true;
  HealthMonitor::Probe probe;
  probe.name = "device";
  probe.check = [&] { return works ? absl::OkStatus() : absl::InternalError("lost"); };
  probe.services = {"a"};
  probe.blocks = false;
  HealthMonitor monitor({"a"}, {probe}, kQuick);
  monitor.Start(published.Callback());
  works = false;
  EXPECT_TRUE(published.Await("a", false));
  works = true;
  EXPECT_TRUE(published.Await("a", true));
}

TEST(HealthMonitor, StopsOnlyTheServicesOfAFailingProbeAndRestoresThem) {
  Published published;
  std::atomic<bool> works = true;
  HealthMonitor monitor(
      {"a", "b"},
      {{"disk", [&] { return works ? absl::OkStatus() : absl::InternalError("full"); }, {"a"}}},
      kQuick);
  monitor.Start(published.Callback());
  EXPECT_TRUE(published.Is("a", true));
  works = false;
  EXPECT_TRUE(published.Await("a", false));
  EXPECT_TRUE(published.Is("b", true));
  works = true;
  EXPECT_TRUE(published.Await("a", true));
}

TEST(HealthMonitor, FailsAProbeThatHangsWithoutDelayingTheOthers) {
  Published published;
  std::promise<void> go_on;
  const std::shared_future<void> gate = go_on.get_future().share();
  std::atomic<bool> other_works = true;
  HealthMonitor monitor(
      {"a", "b"},
      {{"hangs",
        [gate] {
          gate.wait();
          return absl::OkStatus();
        },
        {"a"}},
       {"other", [&] { return other_works ? absl::OkStatus() : absl::InternalError("x"); }, {"b"}}},
      kQuick);
  monitor.Start(published.Callback());
  EXPECT_TRUE(published.Await("a", false));
  EXPECT_TRUE(published.Is("b", true));
  other_works = false;
  EXPECT_TRUE(published.Await("b", false));
  go_on.set_value();
  EXPECT_TRUE(published.Await("a", true));
}

TEST(HealthMonitor, PublishesDrainingAndItsEndAtOnce) {
  Published published;
  std::atomic<int> num_probes = 0;
  const auto probe = [&] {
    ++num_probes;
    return absl::OkStatus();
  };
  HealthMonitor monitor({"a", ""}, {{"fine", probe, {"a"}}}, kQuick);
  monitor.Start(published.Callback());
  monitor.SetDraining(true);
  const int before = num_probes;
  EXPECT_TRUE(published.Is("a", false));
  EXPECT_TRUE(published.Is("", false));
  EXPECT_TRUE(testing::Eventually([&] { return num_probes >= before + 3; }));
  EXPECT_TRUE(published.Is("a", false));
  monitor.SetDraining(false);
  EXPECT_TRUE(published.Is("a", true));
}

TEST(ProbeDisk, FailsWithoutRoomOrFolderAndLeavesNothing) {
  const testing::TempFolder folder;
  EXPECT_OK(ProbeDisk(folder.path(), 0));
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
  const absl::Status full = ProbeDisk(folder.path(), std::numeric_limits<int64_t>::max());
  EXPECT_TRUE(absl::IsResourceExhausted(full)) << full;
  EXPECT_FALSE(ProbeDisk(folder / "missing", 0).ok());
}

TEST(ProbeDevice, FailsWhileTheBackendHasAnError) {
  const auto backend = MakeCpuBackend(1);
  EXPECT_OK(ProbeDevice(*backend));
#ifndef __SANITIZE_ADDRESS__  // which would end the program instead
  const Buffer<float> too_large(*backend, int64_t{1} << 50);
  const absl::Status broken = ProbeDevice(*backend);
  EXPECT_TRUE(absl::IsInternal(broken)) << broken;
  backend->TakeError();
  EXPECT_OK(ProbeDevice(*backend));
#endif
}

}  // namespace
}  // namespace pepeseg
