#include "core/decompose/decompositions.h"

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

struct Asked {
  absl::Status Ask(double scale) {
    return kept.With(
        std::vector<double>{scale},
        [&]() -> absl::StatusOr<Decomposition> {
          ++num_made;
          return Of(scale);
        },
        [&](const Decomposition& made) {
          return made.levels.at(0).scale == scale ? absl::OkStatus() : absl::InternalError("other");
        });
  }
  Decompositions kept;
  std::atomic<int> num_made = 0;
};

TEST(Decompositions, AreMadeOnceForTheirScales) {
  Asked asked;
  for (const double scale : {0.1, 0.2, 0.1, 0.2}) EXPECT_OK(asked.Ask(scale));
  EXPECT_EQ(asked.num_made, 2);
}

TEST(Decompositions, TheLeastRecentlyUsedGo) {
  Asked asked;
  for (int i = 0; i < Decompositions::kMostKept; ++i) EXPECT_OK(asked.Ask(i));
  EXPECT_OK(asked.Ask(0));
  EXPECT_OK(asked.Ask(100));  // in the place of 1
  EXPECT_EQ(asked.num_made, Decompositions::kMostKept + 1);
  EXPECT_OK(asked.Ask(0));
  EXPECT_EQ(asked.num_made, Decompositions::kMostKept + 1);
  EXPECT_OK(asked.Ask(1));
  EXPECT_EQ(asked.num_made, Decompositions::kMostKept + 2);
}

TEST(Decompositions, OnesInUseStay) {
  Asked asked;
  EXPECT_OK(asked.kept.With(
      std::vector<double>{0.5}, [] { return absl::StatusOr<Decomposition>(Of(0.5)); },
      [&](const Decomposition& held) {
        for (int i = 1; i < 10; ++i) EXPECT_OK(asked.Ask(i));
        EXPECT_EQ(held.levels.at(0).scale, 0.5);
        return absl::OkStatus();
      }));
}

TEST(Decompositions, ManyWhoAskAtOnceWaitForOne) {
  Asked asked;
  std::atomic<int> num_wrong = 0;
  std::vector<std::thread> threads;
  threads.reserve(8);
  for (int t = 0; t < 8; ++t) {
    threads.emplace_back([&] {
      for (int i = 0; i < 100; ++i) num_wrong += asked.Ask(i % 3).ok() ? 0 : 1;
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(num_wrong, 0);
  EXPECT_EQ(asked.num_made, 3);
}

TEST(Decompositions, AnErrorIsAnsweredAndNotKept) {
  Asked asked;
  EXPECT_STATUS(asked.kept.With(
                    std::vector<double>{1},
                    [] { return absl::StatusOr<Decomposition>(absl::InternalError("broken")); },
                    [](const Decomposition&) { return absl::OkStatus(); }),
                absl::StatusCode::kInternal, "broken");
  EXPECT_OK(asked.Ask(1));
  EXPECT_EQ(asked.num_made, 1);
}

}  // namespace
}  // namespace pepeseg
