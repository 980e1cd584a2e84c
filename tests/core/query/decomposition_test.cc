#include "core/query/decomposition.h"

#include <gtest/gtest.h>

#include <atomic>
#include <thread>

#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

Decomposition Of(double scale) {
  Decomposition made;
  made.levels.push_back({scale, {}, {}});
  return made;
}

// A cache whose decompositions have one level, of the requested scale.
struct CountedCache {
  absl::Status Request(double scale) {
    return decompositions.With(
        std::vector<double>{scale},
        [&]() -> absl::StatusOr<Decomposition> {
          ++num_made;
          return Of(scale);
        },
        [&](const Decomposition& made) {
          return made.levels.at(0).scale == scale ? absl::OkStatus() : absl::InternalError("other");
        });
  }
  Decompositions decompositions;
  std::atomic<int> num_made = 0;
};

TEST(Decompositions, ComputeEachSetOfScalesOnce) {
  CountedCache cache;
  for (const double scale : {0.1, 0.2, 0.1, 0.2}) EXPECT_OK(cache.Request(scale));
  EXPECT_EQ(cache.num_made, 2);
}

TEST(Decompositions, DropTheLeastRecentlyUsed) {
  CountedCache cache;
  for (int i = 0; i < Decompositions::kMostKept; ++i) EXPECT_OK(cache.Request(i));
  EXPECT_OK(cache.Request(0));
  EXPECT_OK(cache.Request(100));  // replaces 1
  EXPECT_EQ(cache.num_made, Decompositions::kMostKept + 1);
  EXPECT_OK(cache.Request(0));
  EXPECT_EQ(cache.num_made, Decompositions::kMostKept + 1);
  EXPECT_OK(cache.Request(1));
  EXPECT_EQ(cache.num_made, Decompositions::kMostKept + 2);
}

TEST(Decompositions, KeepEntriesInUse) {
  CountedCache cache;
  EXPECT_OK(cache.decompositions.With(
      std::vector<double>{0.5}, [] { return absl::StatusOr<Decomposition>(Of(0.5)); },
      [&](const Decomposition& held) {
        for (int i = 1; i < 10; ++i) EXPECT_OK(cache.Request(i));
        EXPECT_EQ(held.levels.at(0).scale, 0.5);
        return absl::OkStatus();
      }));
}

TEST(Decompositions, ComputeOnceForManyThreads) {
  CountedCache cache;
  std::atomic<int> num_wrong = 0;
  std::vector<std::thread> threads;
  threads.reserve(8);
  for (int t = 0; t < 8; ++t) {
    threads.emplace_back([&] {
      for (int i = 0; i < 100; ++i) num_wrong += cache.Request(i % 3).ok() ? 0 : 1;
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(num_wrong, 0);
  EXPECT_EQ(cache.num_made, 3);
}

TEST(Decompositions, ReturnErrorsWithoutCachingThem) {
  CountedCache cache;
  EXPECT_STATUS(cache.decompositions.With(
                    std::vector<double>{1},
                    [] { return absl::StatusOr<Decomposition>(absl::InternalError("broken")); },
                    [](const Decomposition&) { return absl::OkStatus(); }),
                absl::StatusCode::kInternal, "broken");
  EXPECT_OK(cache.Request(1));
  EXPECT_EQ(cache.num_made, 1);
}

TEST(LevelOfPieces, NumbersSegmentsBySizeThenByPiece) {
  const Gaussians gaussians = Gaussians::Zero(7, 0);
  const std::vector<int32_t> pieces = {3, 0, 1, -1, 3, 1, 3};
  const Decomposition::Level level = LevelOfPieces(0.5, pieces, gaussians);
  EXPECT_EQ(level.ids, (std::vector<int32_t>{1, 3, 2, 0, 1, 2, 1}));
  EXPECT_EQ(level.segments.size(), 3u) << "piece 2 has no Gaussian";
}

}  // namespace
}  // namespace pepeseg
