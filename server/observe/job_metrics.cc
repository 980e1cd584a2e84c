#include "server/observe/job_metrics.h"

#include "server/observe/exposition.h"
#include "server/worker_protocol/job_stage.h"

namespace pepeseg {
namespace {

constexpr char kStageName[] = "pepeseg_job_stage_duration_seconds";
constexpr char kStageHelp[] = "What the stages of jobs took.";
const prometheus::Histogram::BucketBoundaries kStageBounds = {1,   5,    15,   60,   300,
                                                              900, 1800, 3600, 7200, 21600};
// Returns the label `stage`; one for all unknown numbers, so that a worker cannot create arbitrary
// series.
std::string StageLabel(v1::JobStage stage) {
  const std::string name = NameOfStage(stage);
  return name.empty() ? "other" : name;
}

}  // namespace

JobMetrics::JobMetrics() : stage_seconds_(kStageName, kStageHelp, {}) {}

void JobMetrics::Observe(const std::string& job, const v1::JobEvent& event) {
  if (event.has_stage_ended() && event.stage_ended().skipped().empty()) {
    const auto& elapsed = event.stage_ended().elapsed();
    stage_seconds_.Add({{"stage", StageLabel(event.stage_ended().stage())}}, kStageBounds)
        .Observe(static_cast<double>(elapsed.seconds()) + elapsed.nanos() * 1e-9);
  }
  const std::lock_guard lock(mutex_);
  if (event.has_progress()) progress_[job] = event.progress();
  if (event.has_state_changed() && event.state_changed().state() != v1::JOB_STATE_RUNNING) {
    progress_.erase(job);
  }
}

std::vector<prometheus::MetricFamily> JobMetrics::Collect() const {
  std::vector<prometheus::MetricFamily> families = stage_seconds_.Collect();
  if (families.empty()) {
    families.push_back({kStageName, kStageHelp, prometheus::MetricType::Histogram, {}});
  }
  std::map<std::string, v1::JobProgress> running;
  {
    const std::lock_guard lock(mutex_);
    std::erase_if(progress_,
                  [&](const auto& entry) { return is_running_ && !is_running_(entry.first); });
    running = progress_;
  }
  Samples samples(families);
  const auto add = [&](const char* name, const char* help, auto value) {
    samples.Gauge(name, help);
    for (const auto& [job, progress] : running) {
      samples.Add(static_cast<double>(value(progress)),
                  {{"job", job}, {"stage", StageLabel(progress.stage())}});
    }
  };
  using Progress = v1::JobProgress;
  add("pepeseg_job_steps_per_second", "Pace of a job's stage.",
      [](const Progress& progress) { return progress.steps_per_second(); });
  add("pepeseg_job_psnr_decibels", "PSNR of its newest training views.",
      [](const Progress& progress) { return progress.psnr(); });
  add("pepeseg_job_gaussians", "Gaussians that it has.",
      [](const Progress& progress) { return progress.num_gaussians(); });
  add("pepeseg_job_done_ratio", "Steps done of those of its stage.", [](const Progress& progress) {
    return progress.num_steps() == 0
               ? 0.0
               : static_cast<double>(progress.step()) / static_cast<double>(progress.num_steps());
  });
  add("pepeseg_job_worker_resident_bytes", "Memory of its worker.",
      [](const Progress& progress) { return progress.memory_bytes(); });
  return families;
}

}  // namespace pepeseg
