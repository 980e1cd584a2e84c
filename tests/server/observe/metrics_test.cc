#include <gtest/gtest.h>

#include <thread>
#include <vector>

#include "absl/time/clock.h"
#include "server/observe/job_metrics.h"
#include "server/observe/latency_window.h"

namespace pepeseg {
namespace {

TEST(LatencyWindow, ReportsTheLastTenSecondsWithinTenPercent) {
  LatencyWindow window;
  const absl::Time now = absl::FromUnixSeconds(1'000'000);
  for (int i = 0; i < 980; ++i) window.Record(absl::Milliseconds(20), now - absl::Seconds(1));
  for (int i = 0; i < 20; ++i) window.Record(absl::Seconds(3), now - absl::Seconds(10));
  window.Record(absl::Seconds(100), now - absl::Seconds(11));  // too long ago
  window.Record(absl::Seconds(100), now);                      // in the current second
  const auto told = LatencyWindow::Summarize(now, window);
  EXPECT_DOUBLE_EQ(told.per_second, 100);
  EXPECT_NEAR(absl::ToDoubleMilliseconds(told.p50), 20, 2);
  EXPECT_NEAR(absl::ToDoubleMilliseconds(told.p99), 3000, 300);
  EXPECT_EQ(LatencyWindow::Summarize(now + absl::Minutes(1), window).per_second, 0);
}

TEST(LatencyWindow, CountsRecordsOfAllThreads) {
  LatencyWindow window, other;
  const absl::Time now = absl::FromUnixSeconds(1'000'000);
  window.Record(absl::Milliseconds(1), now - absl::Seconds(12));  // an old count in the same slot
  std::vector<std::thread> threads;
  threads.reserve(4);
  for (int t = 0; t < 4; ++t) {
    threads.emplace_back([&] {
      for (int i = 0; i < 10'000; ++i) window.Record(absl::Milliseconds(1), now - absl::Seconds(1));
    });
  }
  for (std::thread& thread : threads) thread.join();
  other.Record(absl::Milliseconds(1), now - absl::Seconds(2));
  EXPECT_DOUBLE_EQ(LatencyWindow::Summarize(now, window, other).per_second, 4000.1);
}

// Returns the samples of a family that have the label.
int CountSamples(const JobMetrics& metrics, const std::string& family, const std::string& label) {
  int count = 0;
  for (const prometheus::MetricFamily& found : metrics.Collect()) {
    if (found.name != family) continue;
    for (const prometheus::ClientMetric& metric : found.metric) {
      for (const auto& has : metric.label) count += has.value == label ? 1 : 0;
    }
  }
  return count;
}

TEST(JobMetrics, RemovesTheSeriesOfAJobThatHasEnded) {
  JobMetrics metrics;
  v1::JobEvent event;
  event.mutable_progress()->set_stage(v1::JOB_STAGE_RECONSTRUCT);
  event.mutable_progress()->set_psnr(21);
  metrics.Observe("j1", event);
  metrics.Observe("j2", event);
  EXPECT_EQ(CountSamples(metrics, "pepeseg_job_psnr_decibels", "j1"), 1);
  event.mutable_state_changed()->set_state(v1::JOB_STATE_RUNNING);
  metrics.Observe("j1", event);
  EXPECT_EQ(CountSamples(metrics, "pepeseg_job_psnr_decibels", "j1"), 1);
  event.mutable_state_changed()->set_state(v1::JOB_STATE_FAILED);
  metrics.Observe("j1", event);
  EXPECT_EQ(CountSamples(metrics, "pepeseg_job_psnr_decibels", "j1"), 0);
  EXPECT_EQ(CountSamples(metrics, "pepeseg_job_psnr_decibels", "j2"), 1);
}

TEST(JobMetrics, RecordsDurationsOfStagesByNameAndUnknownOnesTogether) {
  JobMetrics metrics;
  v1::JobEvent event;
  event.mutable_stage_ended()->set_stage(v1::JOB_STAGE_RECONSTRUCT);
  event.mutable_stage_ended()->mutable_elapsed()->set_seconds(7);
  metrics.Observe("j1", event);
  event.mutable_stage_ended()->set_stage(static_cast<v1::JobStage>(77));
  metrics.Observe("j1", event);
  event.mutable_stage_ended()->set_stage(v1::JOB_STAGE_SFM);
  event.mutable_stage_ended()->set_skipped("given");
  metrics.Observe("j1", event);
  constexpr char kFamily[] = "pepeseg_job_stage_duration_seconds";
  EXPECT_EQ(CountSamples(metrics, kFamily, "reconstruct"), 1);
  EXPECT_EQ(CountSamples(metrics, kFamily, "other"), 1);
  EXPECT_EQ(CountSamples(metrics, kFamily, "sfm"), 0);
}

}  // namespace
}  // namespace pepeseg
