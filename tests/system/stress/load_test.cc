// Short runs of tests/system/stress/load.h. Bounds on times hold in `make stress` only: `make test`
// also runs on machines that build something else meanwhile.
#include "tests/system/stress/load.h"

#include <gtest/gtest.h>

#include "tests/testing/full_stress.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/time_limit.h"

namespace pepeseg {
namespace {

const int kNumAttempts = testing::FullStress() ? 3 : 1;

// Returns whether 800 watchers slow queries down: the median by more than a fifth, or the p99 to
// more than twice what it is without them, and 20 ms.
bool AreQueriesSlower(const WatchersReport& report) {
  return report.p50_ratio > 1.2 ||
         report.p99_with > 2 * report.p99_without + absl::Milliseconds(20);
}

void ExpectNoThreadsOfWatchers(const WatchersReport& report) {
  EXPECT_LE(report.num_threads, report.num_threads_without + 2);
  // Few threads are outside the pools: those that accept connections, compute, end streams, check
  // blobs, write metrics and answer other services. Counted: 19 on two cores.
  EXPECT_LE(report.num_threads, report.pool_threads + 30);
}

TEST(Load, IdleWatchersCostNoThreadsAndHardlySlowQueries) {
  LoadedServer server(PEPESEG_MODEL_WORKER);
  bool slower = true;
  // A few pauses of the machine make a p99. If other load causes them, the run is repeated.
  for (int attempt = 0; slower && attempt < kNumAttempts; ++attempt) {
    const WatchersReport report = RunWatchers(server, 800, 8, absl::Seconds(0.5));
    printf(
        "%ld queries; without watchers p50 %s, p99 %s, %d threads; with %d p50 %s (x %.2f), "
        "p99 %s, %d threads, %d in pools, %.3f s of CPU time a second\n",
        report.num_queries, absl::FormatDuration(report.p50_without).c_str(),
        absl::FormatDuration(report.p99_without).c_str(), report.num_threads_without,
        report.num_streams, absl::FormatDuration(report.p50_with).c_str(), report.p50_ratio,
        absl::FormatDuration(report.p99_with).c_str(), report.num_threads, report.pool_threads,
        report.watchers_cpu);
    EXPECT_EQ(report.num_streams, 800);
    EXPECT_EQ(report.num_failed, 0);
    EXPECT_GT(report.num_queries, 100);
    ExpectNoThreadsOfWatchers(report);
    // Measured 0.026. Unlike times of queries, it hardly depends on other load, which can hide what
    // watchers cost.
    EXPECT_LT(report.watchers_cpu, 0.1);
    slower = AreQueriesSlower(report);
  }
  EXPECT_FALSE(slower && testing::FullStress());
}

TEST(Load, OverloadIsRefusedFastAndOtherCallsAreAnswered) {
  LoadedServer server(PEPESEG_MODEL_WORKER);
  OverloadReport report;
  // The peak and the goodput are measured one after the other. If other load slows the machine down
  // between them, the result means nothing, and the run is repeated.
  for (int attempt = 0; attempt < kNumAttempts; ++attempt) {
    report = RunOverload(server, 5, absl::Seconds(4));
    printf("peak %.0f/s, offered %.0f/s, answered %.0f/s, %ld refused, p50 %s\n",
           report.peak_per_second, report.offered_per_second, report.goodput_per_second,
           report.num_refused, absl::FormatDuration(report.refusal_p50).c_str());
    if (report.goodput_per_second >= 0.7 * report.peak_per_second &&
        report.offered_per_second > 3 * report.peak_per_second) {
      break;
    }
  }
  EXPECT_GT(report.num_refused, 0);
  EXPECT_EQ(report.num_failed, 0);
  if (testing::FullStress()) {
    EXPECT_GT(report.offered_per_second, 3 * report.peak_per_second);
    EXPECT_GE(report.goodput_per_second, 0.7 * report.peak_per_second);
  }
  EXPECT_LT(report.refusal_p50, testing::TimeLimit(absl::Milliseconds(20)));
  EXPECT_TRUE(report.all_had_a_retry_time);
}

TEST(Load, CancelledCallsLeaveNoStreamAndNoCall) {
  LoadedServer server(PEPESEG_MODEL_WORKER);
  const CancelsReport report = RunCancels(server, 10'000);
  printf("%ld cancelled, RSS %ld -> %ld MiB\n", report.num_cancelled, report.rss_before >> 20,
         report.rss_after >> 20);
  EXPECT_EQ(report.num_streams, 0);
  EXPECT_EQ(report.calls_in_flight, 0);
  // Memory is printed and not bounded. It grew by 9 KB per cancelled call when this was written,
  // also without interceptors; the cause is not known.
}

TEST(Load, StreamsBeyondTheLimitAreRefused) {
  constexpr int kMost = 4096;
  LoadedServer server(PEPESEG_MODEL_WORKER);
  const CrowdReport report = RunCrowd(server, kMost);
  EXPECT_EQ(report.num_streams, kMost);
  EXPECT_ERROR(report.beyond, grpc::RESOURCE_EXHAUSTED);
  EXPECT_EQ(DetailOf(report.beyond).reason(), "TOO_MANY_STREAMS");
  EXPECT_EQ(DetailOf(report.beyond).limit(), "4096");
  EXPECT_OK(report.meanwhile);
  EXPECT_EQ(report.num_streams_after, 0);
}

TEST(Load, UnreadExportsHoldAChunkAndAreCounted) {
  constexpr int kNumExports = 40;
  LoadedServer server(PEPESEG_MODEL_WORKER);
  const UnreadExportsReport report = RunUnreadExports(server, kNumExports);
  printf("%d exports of %ld KiB, RSS %ld -> %ld MiB, reserved %.0f -> %.0f KiB\n",
         report.num_streams, report.export_bytes >> 10, report.rss_before >> 20,
         report.rss_with >> 20, report.reserved_before / 1024, report.reserved_with / 1024);
  EXPECT_EQ(report.num_streams, kNumExports);
  EXPECT_EQ(report.num_streams_after, 0);
  EXPECT_GT(report.export_bytes, int64_t{8} << 20);
  // For each export a chunk in the server, one in transit, and the indices; never the whole PLY.
  EXPECT_LT(report.rss_with - report.rss_before, kNumExports * (int64_t{3} << 20));
  const double counted = (report.reserved_with - report.reserved_before) / kNumExports;
  EXPECT_GE(counted, 2 << 20);
  EXPECT_LT(counted, 3 << 20);
  EXPECT_EQ(report.reserved_after, report.reserved_before);
}

TEST(Load, StreamsThatNobodyReadsAreBounded) {
  LoadedServer server(PEPESEG_MODEL_WORKER);
  const UnreadReport report = RunUnread(server, 100);
  printf("%d streams, RSS %ld -> %ld MiB\n", report.num_streams, report.rss_before >> 20,
         report.rss_with >> 20);
  EXPECT_EQ(report.num_streams, 100);
  EXPECT_EQ(report.num_streams_after, 0);
  // For each export a chunk in the server and one in transit.
  EXPECT_LT(report.rss_with - report.rss_before, 50 * (int64_t{3} << 20));
}

}  // namespace
}  // namespace pepeseg
