#include "server/observe/metrics.h"

#include <gtest/gtest.h>

namespace pepeseg {
namespace {

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
