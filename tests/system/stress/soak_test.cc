// Runs scene lives one after the other for PEPESEG_SOAK_SECONDS (20 in `make test`, an hour in
// `make stress`). Memory, descriptors and threads of the server must not grow.
#include <gtest/gtest.h>

#include <atomic>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <thread>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "tests/server/pepesegd_process.h"
#include "tests/system/stress/life_of_a_scene.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

struct Usage {
  int64_t rss_kib = 0;
  int64_t threads = 0;
  int64_t descriptors = 0;
};

Usage MeasureProcess(pid_t pid) {
  Usage usage;
  std::ifstream status(absl::StrCat("/proc/", pid, "/status"));
  for (std::string word; status >> word;) {
    if (word == "VmRSS:") status >> usage.rss_kib;
    if (word == "Threads:") status >> usage.threads;
  }
  std::error_code error;
  for (std::filesystem::directory_iterator entry(absl::StrCat("/proc/", pid, "/fd"), error), end;
       !error && entry != end; entry.increment(error)) {
    ++usage.descriptors;
  }
  return usage;
}

int SoakSeconds() {
  const char* seconds = std::getenv("PEPESEG_SOAK_SECONDS");
  return seconds == nullptr ? 20 : std::atoi(seconds);
}

// Four clients may use a model each at the same time. One model and its first query need 281 MB.
constexpr char kModelMemory[] = "--model-memory=1300MB";

TEST(Soak, MemoryDescriptorsAndThreadsStayFlat) {
  const testing::TempFolder folder;
  testing::PepesegdProcess server(
      folder / "data",
      testing::PepesegdOptions{{kModelMemory}, {}, PEPESEG_MODEL_WORKER, "", false});
  const absl::Time start = absl::Now();
  const absl::Duration length = absl::Seconds(SoakSeconds());
  std::atomic<int> num_lives = 0;
  std::vector<std::thread> clients;
  for (int client = 0; client < 4; ++client) {
    clients.emplace_back([&, client] {
      for (int i = 0; absl::Now() - start < length; ++i) {
        LifeOfAScene life(absl::StrCat("c", client, "-", i));
        EXPECT_OK(life.Run(server.channel()));
        EXPECT_OK(life.Delete(server.channel()));
        ++num_lives;
      }
    });
  }
  // The first third fills caches, pools and the allocator.
  absl::SleepFor(length / 3);
  const Usage before = MeasureProcess(server.pid());
  Usage most = before;
  while (absl::Now() - start < length) {
    absl::SleepFor(absl::Milliseconds(500));
    const Usage now = MeasureProcess(server.pid());
    most = {std::max(most.rss_kib, now.rss_kib), std::max(most.threads, now.threads),
            std::max(most.descriptors, now.descriptors)};
  }
  for (std::thread& client : clients) client.join();
  const Usage after = MeasureProcess(server.pid());
  std::cout << num_lives << " lives; RSS " << (before.rss_kib >> 10) << " -> "
            << (after.rss_kib >> 10) << " MiB (most " << (most.rss_kib >> 10) << "), threads "
            << before.threads << " -> " << after.threads << ", descriptors " << before.descriptors
            << " -> " << after.descriptors << "\n";
  EXPECT_GT(num_lives, 3);
  EXPECT_LE(most.rss_kib, before.rss_kib * 5 / 4 + (64 << 10));
  EXPECT_LE(most.threads, before.threads + 4);
  EXPECT_LE(most.descriptors, before.descriptors + 40);
}

}  // namespace
}  // namespace pepeseg
