#include "server/residency/resident_cache.h"

#include <gtest/gtest.h>

#include <atomic>
#include <thread>
#include <vector>

namespace pepeseg {
namespace {

struct Thing {
  explicit Thing(int number) : value(number) { ++alive; }
  ~Thing() { --alive; }
  Thing(const Thing&) = delete;
  Thing& operator=(const Thing&) = delete;
  int value;
  static inline std::atomic<int> alive = 0;
};

using Cache = ResidentCache<Thing>;

Cache::Loader Load(int value, std::atomic<int>* count = nullptr) {
  return [=]() -> absl::StatusOr<std::unique_ptr<Thing>> {
    if (count != nullptr) ++*count;
    return std::make_unique<Thing>(value);
  };
}

TEST(ResidentCache, LoadsOnceAndKeeps) {
  Cache cache(100);
  std::atomic<int> loads = 0;
  for (int i = 0; i < 3; ++i) {
    const auto handle = cache.Acquire("a", 10, Load(7, &loads));
    ASSERT_TRUE(handle.ok());
    EXPECT_EQ((*handle)->value, 7);
  }
  EXPECT_EQ(loads, 1);
  EXPECT_EQ(cache.bytes_in_use(), 10);
}

TEST(ResidentCache, OneLoadHoweverManyAsk) {
  Cache cache(100);
  std::atomic<int> loads = 0;
  std::atomic<int> right = 0;
  const auto slow = [&]() -> absl::StatusOr<std::unique_ptr<Thing>> {
    ++loads;
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    return std::make_unique<Thing>(3);
  };
  std::vector<std::thread> threads;
  threads.reserve(8);
  for (int i = 0; i < 8; ++i) {
    threads.emplace_back([&] {
      const auto handle = cache.Acquire("a", 10, slow);
      if (handle.ok() && (*handle)->value == 3) ++right;
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(loads, 1);
  EXPECT_EQ(right, 8);
}

TEST(ResidentCache, EvictsTheLeastRecentlyUsed) {
  Cache cache(30);
  std::atomic<int> loads = 0;
  ASSERT_TRUE(cache.Acquire("a", 10, Load(1, &loads)).ok());
  ASSERT_TRUE(cache.Acquire("b", 10, Load(2, &loads)).ok());
  ASSERT_TRUE(cache.Acquire("c", 10, Load(3, &loads)).ok());
  ASSERT_TRUE(cache.Acquire("a", 10, Load(1, &loads)).ok());  // b is the oldest now
  ASSERT_TRUE(cache.Acquire("d", 10, Load(4, &loads)).ok());
  EXPECT_EQ(loads, 4);
  EXPECT_EQ(Thing::alive, 3);
  ASSERT_TRUE(cache.Acquire("a", 10, Load(1, &loads)).ok());
  ASSERT_TRUE(cache.Acquire("c", 10, Load(3, &loads)).ok());
  EXPECT_EQ(loads, 4);
  ASSERT_TRUE(cache.Acquire("b", 10, Load(2, &loads)).ok());
  EXPECT_EQ(loads, 5);
  EXPECT_EQ(cache.bytes_in_use(), 30);
}

TEST(ResidentCache, NeverEvictsWhatIsHeld) {
  Cache cache(30);
  const auto held = cache.Acquire("a", 20, Load(1));
  ASSERT_TRUE(held.ok());
  const auto refused = cache.Acquire("b", 15, Load(2));
  EXPECT_TRUE(absl::IsResourceExhausted(refused.status()));
  EXPECT_NE(refused.status().message().find("needs 15 bytes"), std::string::npos);
  EXPECT_NE(refused.status().message().find("10 of 30"), std::string::npos);
  EXPECT_EQ((*held)->value, 1);
  EXPECT_TRUE(cache.Acquire("c", 10, Load(3)).ok());
}

TEST(ResidentCache, HandlesOutliveADropAndKeepTheirBytes) {
  Cache cache(30);
  std::atomic<int> loads = 0;
  {
    const auto held = cache.Acquire("a", 20, Load(1, &loads));
    ASSERT_TRUE(held.ok());
    cache.Drop("a");
    EXPECT_EQ((*held)->value, 1);
    EXPECT_EQ(cache.bytes_in_use(), 20);
    EXPECT_TRUE(absl::IsResourceExhausted(cache.Acquire("a", 20, Load(1, &loads)).status()));
  }
  EXPECT_EQ(Thing::alive, 0);
  EXPECT_EQ(cache.bytes_in_use(), 0);
  EXPECT_TRUE(cache.Acquire("a", 20, Load(1, &loads)).ok());
  EXPECT_EQ(loads, 2);
}

TEST(ResidentCache, HandlesOutliveTheCache) {
  Cache::Handle handle;
  {
    Cache cache(30);
    handle = *cache.Acquire("a", 20, Load(5));
  }
  EXPECT_EQ(handle->value, 5);
  handle.reset();
  EXPECT_EQ(Thing::alive, 0);
}

TEST(ResidentCache, AFailedLoadIsToldAndTriedAgain) {
  Cache cache(30);
  const auto fail = []() -> absl::StatusOr<std::unique_ptr<Thing>> {
    return absl::DataLossError("gaussians.ply: wrong checksum");
  };
  EXPECT_TRUE(absl::IsDataLoss(cache.Acquire("a", 20, fail).status()));
  EXPECT_EQ(cache.bytes_in_use(), 0);
  EXPECT_TRUE(cache.Acquire("a", 20, Load(1)).ok());
}

TEST(ResidentCache, ManyThreadsUnderATightBudget) {
  std::atomic<int> wrong = 0;
  {
    Cache cache(35);
    std::vector<std::thread> threads;
    threads.reserve(4);
    for (int t = 0; t < 4; ++t) {
      threads.emplace_back([&, t] {
        for (int i = 0; i < 500; ++i) {
          const int key = (i * 7 + t) % 5;
          const auto handle = cache.Acquire(std::to_string(key), 10, Load(key));
          const bool full = absl::IsResourceExhausted(handle.status());
          if (!full && (!handle.ok() || (*handle)->value != key)) ++wrong;
          if (i % 50 == 0) cache.Drop(std::to_string(key));
        }
      });
    }
    for (std::thread& thread : threads) thread.join();
    EXPECT_LE(cache.bytes_in_use(), 35);
  }
  EXPECT_EQ(wrong, 0);
  EXPECT_EQ(Thing::alive, 0);
}

}  // namespace
}  // namespace pepeseg
