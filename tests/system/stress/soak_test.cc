// Runs scene lives one after the other: a few in `make test`, for PEPESEG_SOAK_SECONDS in `make
// stress`. Memory, descriptors and threads of the server must not grow.
#include <gtest/gtest.h>

#include <algorithm>
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
#include "tests/testing/eventually.h"
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

constexpr int kNumClients = 4;
// Lives of each client that fill caches, pools and the allocator, and lives after them.
constexpr int kWarmLives = 2, kShortLives = 2;

absl::Duration SoakLength() {
  const char* seconds = std::getenv("PEPESEG_SOAK_SECONDS");
  return absl::Seconds(seconds == nullptr ? 0 : std::atoi(seconds));
}

// Four clients may use a model each at the same time. One model and its first query need 281 MB.
constexpr char kModelMemory[] = "--model-memory=1300MB";

TEST(Soak, MemoryDescriptorsAndThreadsStayFlat) {
  const testing::TempFolder folder;
  testing::PepesegdProcess server(
      folder / "data",
      testing::PepesegdOptions{{kModelMemory}, {}, PEPESEG_MODEL_WORKER, "", false});
  const absl::Time end = absl::Now() + SoakLength();
  std::atomic<int> num_lives = 0, num_done = 0;
  std::vector<std::thread> clients;
  for (int client = 0; client < kNumClients; ++client) {
    clients.emplace_back([&, client] {
      for (int i = 0; i < kWarmLives + kShortLives || absl::Now() < end; ++i) {
        LifeOfAScene life(absl::StrCat("c", client, "-", i));
        EXPECT_OK(life.Run(server.channel()));
        EXPECT_OK(life.Delete(server.channel()));
        ++num_lives;
      }
      ++num_done;
    });
  }
  EXPECT_TRUE(testing::Eventually(
      [&] {
        return num_lives >= kNumClients * kWarmLives && absl::Now() > end - SoakLength() * 2 / 3;
      },
      SoakLength() + absl::Minutes(5)));
  const Usage before = MeasureProcess(server.pid());
  Usage most = before;
  EXPECT_TRUE(testing::Eventually(
      [&] {
        const Usage now = MeasureProcess(server.pid());
        most = {std::max(most.rss_kib, now.rss_kib), std::max(most.threads, now.threads),
                std::max(most.descriptors, now.descriptors)};
        return num_done == kNumClients;
      },
      SoakLength() + absl::Minutes(5)));
  for (std::thread& client : clients) client.join();
  Usage after;
  EXPECT_TRUE(testing::Eventually([&] {
    after = MeasureProcess(server.pid());
    return after.descriptors <= before.descriptors + 4;
  }));
  std::cout << num_lives << " lives; RSS " << (before.rss_kib >> 10) << " -> "
            << (after.rss_kib >> 10) << " MiB (most " << (most.rss_kib >> 10) << "), threads "
            << before.threads << " -> " << after.threads << ", descriptors " << before.descriptors
            << " -> " << after.descriptors << "\n";
  EXPECT_LE(most.rss_kib, before.rss_kib * 5 / 4 + (64 << 10));
  // gRPC keeps up to two executor threads a core, which it starts when all others are busy.
  const auto of_load = 2 * static_cast<int64_t>(std::thread::hardware_concurrency());
  EXPECT_LE(most.threads, before.threads + std::max<int64_t>(4, of_load));
  // A life has its connection, files that it uploads, and the pipes and logs of its worker open; how
  // many lives are at the same point depends on the machine's load.
  constexpr int64_t kOfALife = 20;
  EXPECT_LE(most.descriptors, before.descriptors + kNumClients * kOfALife);
}

}  // namespace
}  // namespace pepeseg
