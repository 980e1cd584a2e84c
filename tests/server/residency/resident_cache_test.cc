#include "server/residency/resident_cache.h"

#include <gtest/gtest.h>

#include <atomic>
#include <thread>
#include <vector>

#include "tests/testing/status_testing.h"

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

// Returns a budget of one memory whose limit is `usable` bytes after the 5 % that stay free.
MemoryBudget HostBudget(int64_t usable) { return {{usable * 20 / 19, 0}, true}; }

Cache::Source Load(int value, int64_t num_bytes, std::atomic<int>* count = nullptr) {
  return {"thing " + std::to_string(value), "",
          [=] {
            return MemoryBytes{num_bytes, 0};
          },
          [=]() -> absl::StatusOr<std::unique_ptr<Thing>> {
            if (count != nullptr) ++*count;
            return std::make_unique<Thing>(value);
          }};
}

TEST(ResidentCache, LoadsOnceAndKeeps) {
  Cache cache(HostBudget(100));
  std::atomic<int> loads = 0;
  for (int i = 0; i < 3; ++i) {
    ASSERT_OK_AND_ASSIGN(const auto handle, cache.Acquire("a", Load(7, 10, &loads)));
    EXPECT_EQ(handle->value, 7);
  }
  EXPECT_EQ(loads, 1);
  EXPECT_EQ(cache.bytes_in_use().host, 10);
}

TEST(ResidentCache, SharesOneLoadAmongCallers) {
  Cache cache(HostBudget(100));
  std::atomic<int> loads = 0;
  std::atomic<int> right = 0;
  Cache::Source slow = Load(3, 10);
  slow.load = [&]() -> absl::StatusOr<std::unique_ptr<Thing>> {
    ++loads;
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    return std::make_unique<Thing>(3);
  };
  std::vector<std::thread> threads;
  threads.reserve(8);
  for (int i = 0; i < 8; ++i) {
    threads.emplace_back([&] {
      const auto handle = cache.Acquire("a", slow);
      if (handle.ok() && (*handle)->value == 3) ++right;
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(loads, 1);
  EXPECT_EQ(right, 8);
}

TEST(ResidentCache, EvictsTheLeastRecentlyUsed) {
  Cache cache(HostBudget(30));
  std::atomic<int> loads = 0;
  ASSERT_OK(cache.Acquire("a", Load(1, 10, &loads)));
  ASSERT_OK(cache.Acquire("b", Load(2, 10, &loads)));
  ASSERT_OK(cache.Acquire("c", Load(3, 10, &loads)));
  ASSERT_OK(cache.Acquire("a", Load(1, 10, &loads)));  // b is the oldest now
  ASSERT_OK(cache.Acquire("d", Load(4, 10, &loads)));
  EXPECT_EQ(loads, 4);
  EXPECT_EQ(Thing::alive, 3);
  ASSERT_OK(cache.Acquire("a", Load(1, 10, &loads)));
  ASSERT_OK(cache.Acquire("c", Load(3, 10, &loads)));
  EXPECT_EQ(loads, 4);
  ASSERT_OK(cache.Acquire("b", Load(2, 10, &loads)));
  EXPECT_EQ(loads, 5);
  EXPECT_EQ(cache.bytes_in_use().host, 30);
}

TEST(ResidentCache, NeverEvictsWhatIsHeld) {
  Cache cache(HostBudget(30));
  ASSERT_OK_AND_ASSIGN(const auto held, cache.Acquire("a", Load(1, 20)));
  const auto refused = cache.Acquire("b", Load(2, 15));
  EXPECT_TRUE(absl::IsUnavailable(refused.status())) << "it fits once a is given back";
  EXPECT_NE(refused.status().message().find("needs 15 bytes of host memory"), std::string::npos);
  EXPECT_NE(refused.status().message().find("10 of 30"), std::string::npos);
  EXPECT_EQ(held->value, 1);
  EXPECT_OK(cache.Acquire("c", Load(3, 10)));
}

TEST(ResidentCache, ReportsWhetherWaitingCanHelp) {
  Cache cache(HostBudget(30));
  auto held = cache.Acquire("a", Load(1, 20));
  ASSERT_OK(held);
  EXPECT_TRUE(absl::IsUnavailable(cache.Acquire("b", Load(2, 30)).status()));
  EXPECT_TRUE(absl::IsResourceExhausted(cache.Acquire("b", Load(2, 31)).status()));
  held = absl::CancelledError();
  EXPECT_OK(cache.Acquire("b", Load(2, 30)));
}

TEST(ResidentCache, KeepsDroppedValuesForTheirHandles) {
  Cache cache(HostBudget(30));
  std::atomic<int> loads = 0;
  {
    ASSERT_OK_AND_ASSIGN(const auto held, cache.Acquire("a", Load(1, 20, &loads)));
    cache.Drop("a");
    EXPECT_EQ(held->value, 1);
    EXPECT_EQ(cache.bytes_in_use().host, 20);
    EXPECT_TRUE(absl::IsUnavailable(cache.Acquire("a", Load(1, 20, &loads)).status()));
  }
  EXPECT_EQ(Thing::alive, 0);
  EXPECT_EQ(cache.bytes_in_use().host, 0);
  EXPECT_OK(cache.Acquire("a", Load(1, 20, &loads)));
  EXPECT_EQ(loads, 2);
}

TEST(ResidentCache, LetsHandlesOutliveTheCache) {
  Cache::Handle handle;
  {
    Cache cache(HostBudget(30));
    handle = *cache.Acquire("a", Load(5, 20));
  }
  EXPECT_EQ(handle->value, 5);
  handle.reset();
  EXPECT_EQ(Thing::alive, 0);
}

TEST(ResidentCache, ReportsAFailedLoadAndTriesAgain) {
  Cache cache(HostBudget(30));
  Cache::Source fail = Load(1, 20);
  fail.load = []() -> absl::StatusOr<std::unique_ptr<Thing>> {
    return absl::DataLossError("gaussians.ply: wrong checksum");
  };
  EXPECT_TRUE(absl::IsDataLoss(cache.Acquire("a", fail).status()));
  EXPECT_EQ(cache.bytes_in_use().host, 0);
  fail.need = []() -> absl::StatusOr<MemoryBytes> { return absl::DataLossError("model.json"); };
  EXPECT_TRUE(absl::IsDataLoss(cache.Acquire("a", fail).status()));
  EXPECT_OK(cache.Acquire("a", Load(1, 20)));
  EXPECT_EQ(cache.counts().num_loads, 1);
}

// Nothing is evicted for a value that would not fit anyway.
TEST(ResidentCache, EvictsNothingForAValueThatIsTooLarge) {
  Cache cache(HostBudget(30));
  ASSERT_OK(cache.Acquire("a", Load(1, 10)));
  ASSERT_OK(cache.Acquire("b", Load(2, 10)));
  EXPECT_TRUE(absl::IsResourceExhausted(cache.Acquire("c", Load(3, 31)).status()));
  EXPECT_EQ(Thing::alive, 2);
  EXPECT_EQ(cache.counts().num_evictions, 0);
  ASSERT_OK(cache.Acquire("c", Load(3, 30)));
  EXPECT_EQ(Thing::alive, 1);
  EXPECT_EQ(cache.counts().num_evictions, 2);
}

TEST(ResidentCache, HasBudgetsForHostAndDevice) {
  const auto thing = [](const MemoryBytes& need) {
    Cache::Source source = Load(1, 0);
    source.need = [need] { return need; };
    return source;
  };
  Cache cache(MemoryBudget({1000, 100}, /*one_memory=*/false));
  ASSERT_OK(cache.Acquire("a", thing({10, 60})));
  ASSERT_OK(cache.Acquire("b", thing({10, 30})));
  EXPECT_EQ(cache.counts().num_evictions, 0);
  ASSERT_OK(cache.Acquire("c", thing({10, 30})));  // of the device's 95 there are 5
  EXPECT_EQ(cache.counts().num_evictions, 1);
  EXPECT_EQ(cache.bytes_in_use().host, 20);
  EXPECT_EQ(cache.bytes_in_use().device, 60);
  EXPECT_STATUS(cache.Acquire("d", thing({10, 96})), absl::StatusCode::kResourceExhausted,
                "needs 96 bytes of device memory, 95 of 95");
  const absl::Status of_host = cache.Acquire("d", thing({951, 1})).status();
  EXPECT_NE(of_host.message().find("needs 951 bytes of host memory, 950 of 950"), std::string::npos)
      << of_host;
}

TEST(ResidentCache, SharesOneMemory) {
  Cache cache(MemoryBudget({100, 7}, /*one_memory=*/true));
  Cache::Source source = Load(1, 0);
  source.need = [] { return MemoryBytes{45, 50}; };
  ASSERT_OK(cache.Acquire("a", source));
  EXPECT_EQ(cache.bytes_in_use().host, 95);
  source.need = [] { return MemoryBytes{46, 50}; };
  EXPECT_TRUE(absl::IsResourceExhausted(cache.Acquire("b", source).status()));
}

TEST(ResidentCache, KeepsPinnedValues) {
  Cache cache(HostBudget(20));
  EXPECT_TRUE(absl::IsNotFound(cache.SetPinned("a", true)));
  ASSERT_OK(cache.Acquire("a", Load(1, 10)));
  ASSERT_OK(cache.SetPinned("a", true));
  ASSERT_OK(cache.Acquire("b", Load(2, 10)));
  std::atomic<int> loads = 0;
  ASSERT_OK(cache.Acquire("c", Load(3, 10)));  // instead of b, though a is older
  ASSERT_OK(cache.Acquire("a", Load(1, 10, &loads)));
  EXPECT_EQ(loads, 0);
  EXPECT_TRUE(absl::IsResourceExhausted(cache.Acquire("d", Load(4, 11)).status()));
  EXPECT_TRUE(absl::IsFailedPrecondition(cache.Unload("a")));
  ASSERT_OK(cache.SetPinned("a", false));
  EXPECT_OK(cache.Unload("a"));
  EXPECT_TRUE(absl::IsNotFound(cache.Unload("a")));
  EXPECT_EQ(cache.bytes_in_use().host, 10);
}

TEST(ResidentCache, ReleasesMemoryBeforeItCountsAsFree) {
  std::atomic<int> num_released = 0;
  int64_t used_then = 0;
  {
    std::unique_ptr<Cache> cache;
    cache = std::make_unique<Cache>(HostBudget(20), [&] {
      EXPECT_EQ(Thing::alive, num_released == 0 ? 1 : 0);
      used_then = ++num_released == 1 ? cache->bytes_in_use().host : 0;
    });
    ASSERT_OK(cache->Acquire("a", Load(1, 12)));
    ASSERT_OK(cache->Acquire("b", Load(2, 5)));
    ASSERT_OK(cache->Unload("b"));
    EXPECT_EQ(num_released, 1);
    EXPECT_EQ(used_then, 17);
    EXPECT_EQ(cache->bytes_in_use().host, 12);
    used_then = 0;
    ASSERT_OK(cache->Unload("a"));
  }
  EXPECT_EQ(num_released, 2);
}

TEST(ResidentCache, ListsResidentValues) {
  Cache cache(HostBudget(30));
  const absl::Time before = absl::Now();
  const auto held = cache.Acquire("a", Load(1, 10));
  ASSERT_OK(cache.Acquire("b", Load(2, 5)));
  ASSERT_OK(cache.SetPinned("b", true));
  std::vector<std::string> lines;
  cache.Visit([&](const Cache::Info& info, const Thing& thing) {
    EXPECT_GE(info.last_use, before);
    EXPECT_LE(info.last_use, absl::Now());
    lines.push_back(absl::StrCat(info.name, " ", thing.value, " ", info.bytes.host, " ",
                                 info.pinned, " ", info.num_handles));
  });
  EXPECT_EQ(lines, (std::vector<std::string>{"thing 1 1 10 0 1", "thing 2 2 5 1 0"}));
}

TEST(ResidentCache, ServesManyThreadsUnderATightBudget) {
  std::atomic<int> wrong = 0;
  {
    Cache cache(HostBudget(35));
    std::vector<std::thread> threads;
    threads.reserve(4);
    for (int t = 0; t < 4; ++t) {
      threads.emplace_back([&, t] {
        for (int i = 0; i < 500; ++i) {
          const int key = (i * 7 + t) % 5;
          const auto handle = cache.Acquire(std::to_string(key), Load(key, 10));
          const bool full = absl::IsUnavailable(handle.status());
          if (!full && (!handle.ok() || (*handle)->value != key)) ++wrong;
          if (i % 50 == 0) cache.Drop(std::to_string(key));
        }
      });
    }
    for (std::thread& thread : threads) thread.join();
    EXPECT_LE(cache.bytes_in_use().host, 35);
  }
  EXPECT_EQ(wrong, 0);
  EXPECT_EQ(Thing::alive, 0);
}

Cache::Source LoadFor(const std::string& owner, int64_t limit, int64_t num_bytes) {
  Cache::Source source = Load(1, num_bytes);
  source.share = [=]() -> absl::StatusOr<Cache::Share> {
    return Cache::Share{owner, limit, [](int64_t need) {
                          return absl::ResourceExhaustedError("share: " + std::to_string(need));
                        }};
  };
  return source;
}

TEST(ResidentCache, EvictsValuesOfAnOwnerOverItsShare) {
  Cache cache(HostBudget(100));
  ASSERT_OK(cache.Acquire("other", LoadFor("b", 50, 10)));  // the oldest of all
  ASSERT_OK(cache.Acquire("one", LoadFor("a", 30, 20)));
  EXPECT_EQ(cache.BytesOf("a"), 20);
  ASSERT_OK_AND_ASSIGN(const auto held, cache.Acquire("two", LoadFor("a", 30, 20)));
  EXPECT_EQ(cache.BytesOf("a"), 20) << "the first one has gone";
  EXPECT_EQ(cache.BytesOf("b"), 10);
  // The owner has nothing to evict, although the budget has room.
  EXPECT_STATUS(cache.Acquire("three", LoadFor("a", 30, 20)), absl::StatusCode::kUnavailable,
                "share: 40");
  EXPECT_EQ(cache.BytesOf("a"), 20);
  EXPECT_OK(cache.Acquire("four", LoadFor("b", 50, 40))) << "is of another";
  EXPECT_EQ(cache.BytesOf("b"), 50);
  EXPECT_EQ(cache.BytesOf("c"), 0);
}

TEST(ResidentCache, EvictsNothingForAValueOverItsShare) {
  Cache cache(HostBudget(100));
  ASSERT_OK(cache.Acquire("one", LoadFor("a", 30, 20)));
  EXPECT_EQ(cache.Acquire("two", LoadFor("a", 30, 31)).status(),
            absl::ResourceExhaustedError("share: 31"));
  EXPECT_EQ(cache.BytesOf("a"), 20);
  EXPECT_EQ(cache.counts().num_evictions, 0);
}

}  // namespace
}  // namespace pepeseg
