#include "server/worker/worker_progress.h"

#include <google/protobuf/util/time_util.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <fstream>

#include "server/worker_protocol/job_stage.h"

namespace pepeseg {
namespace {

using google::protobuf::util::TimeUtil;

double Seconds(WorkerProgress::Clock::duration duration) {
  return std::chrono::duration<double>(duration).count();
}

google::protobuf::Duration ToProto(double seconds) {
  return TimeUtil::MicrosecondsToDuration(std::llround(seconds * 1e6));
}

// Returns the resident memory of this process, bytes; 0: unknown.
int64_t ResidentBytes() {
  std::ifstream file("/proc/self/statm");
  int64_t num_pages = 0;
  int64_t num_resident = 0;
  file >> num_pages >> num_resident;
  return file ? num_resident * sysconf(_SC_PAGESIZE) : 0;
}

v1::JobProgress::Diagnostics DiagnosticsOf(const StepReport& report) {
  v1::JobProgress::Diagnostics diagnostics;
  diagnostics.set_num_culled_degenerate(report.num_culled_degenerate);
  diagnostics.set_num_skipped_gradients(report.num_skipped_gradients);
  diagnostics.set_num_overflowed_renders(report.num_overflowed_renders);
  diagnostics.set_num_refined(report.num_refined);
  diagnostics.set_num_refine_split(report.num_refine_split);
  if (std::isfinite(report.depth_loss)) diagnostics.set_depth_loss(report.depth_loss);
  diagnostics.set_num_skipped_depths(report.num_skipped_depths);
  return diagnostics;
}

}  // namespace

double WorkerProgress::seconds_in_stage() const { return Seconds(Clock::now() - stage_start_); }

double WorkerProgress::Now() const { return Seconds(Clock::now().time_since_epoch()); }

absl::Status WorkerProgress::StartStage(Stage stage) {
  stage_ = stage;
  activity_.clear();
  stage_start_ = Clock::now();
  eta_.StartStage(stage, Seconds(stage_start_.time_since_epoch()));
  last_event_ = stage_start_;
  first_step_ = 0;
  last_step_ = 0;
  psnr_sum_ = 0;
  num_psnr_ = 0;
  v1::JobEvent event;
  event.mutable_stage_started()->set_stage(ToProto(stage));
  return log_.Append(std::move(event));
}

void WorkerProgress::ResumeAt(int64_t step) { first_step_ = last_step_ = step; }

absl::Status WorkerProgress::EndStage(const TrainingMetrics& metrics,
                                      v1::JobEvent::StageEnded end) {
  end.set_stage(ToProto(stage_));
  eta_.EndStage(Now());
  *end.mutable_elapsed() = ToProto(seconds_in_stage());
  for (const auto& [name, value] : metrics.ByName()) (*end.mutable_metrics())[name] = value;
  v1::JobEvent event;
  *event.mutable_stage_ended() = std::move(end);
  return log_.Append(std::move(event));
}

// Estimates the time that the skipped steps would have taken at the pace of the stage so far.
absl::Status WorkerProgress::SkipPart(const SkippedPart& skipped) {
  v1::JobEvent event;
  v1::JobEvent::TermSkipped& part = *event.mutable_term_skipped();
  part.set_stage(ToProto(stage_));
  part.set_term(ToProto(skipped.part));
  part.set_reason(skipped.reason);
  part.set_step(skipped.step);
  const int64_t num_done = skipped.step - first_step_;
  if (skipped.saved_steps > 0 && num_done > 0) {
    part.set_saved_steps(skipped.saved_steps);
    *part.mutable_saved() = ToProto(seconds_in_stage() * static_cast<double>(skipped.saved_steps) /
                                    static_cast<double>(num_done));
  }
  return log_.Append(std::move(event));
}

absl::Status WorkerProgress::ShowPreview(const Preview& preview) {
  static_assert(kMaxPreviewBytes <= kMaxEventJpeg && kMaxPreviewSide <= kMaxEventSide);
  v1::JobEvent event;
  v1::JobEvent::Preview& shown = *event.mutable_preview();
  shown.set_stage(ToProto(stage_));
  shown.set_step(preview.step);
  shown.set_num_steps(preview.num_steps);
  shown.set_view(preview.view);
  shown.set_width(preview.width);
  shown.set_height(preview.height);
  shown.set_jpeg(preview.jpeg);
  return log_.Append(std::move(event));
}

absl::Status WorkerProgress::Warn(const std::string& message) {
  v1::JobEvent event;
  event.mutable_warning()->set_message(message);
  return log_.Append(std::move(event));
}

absl::Status WorkerProgress::Step(const StepReport& report) {
  if (std::isfinite(report.psnr)) {
    psnr_sum_ += report.psnr;
    ++num_psnr_;
  }
  const Clock::time_point now = Clock::now();
  const bool first_or_last = report.step == first_step_ + 1 || report.step == report.num_steps ||
                             report.activity != activity_;
  // Bounds the size of the event log: most steps only add to the mean PSNR of the next event.
  if (!first_or_last && now - last_event_ < interval_) return absl::OkStatus();
  v1::JobEvent event;
  *event.mutable_progress() = Describe(report);
  last_event_ = now;
  last_step_ = report.step;
  activity_ = std::string(report.activity);
  psnr_sum_ = 0;
  num_psnr_ = 0;
  return log_.Append(std::move(event));
}

v1::JobProgress WorkerProgress::Describe(const StepReport& report) {
  v1::JobProgress progress;
  progress.set_stage(ToProto(stage_));
  progress.set_step(report.step);
  progress.set_num_steps(report.num_steps);
  if (std::isfinite(report.loss)) progress.set_loss(report.loss);
  if (num_psnr_ > 0) progress.set_psnr(psnr_sum_ / static_cast<double>(num_psnr_));
  progress.set_num_gaussians(report.num_gaussians);
  *progress.mutable_diagnostics() = DiagnosticsOf(report);
  progress.set_activity(std::string(report.activity));
  progress.set_unit(std::string(report.unit));
  DescribeTimes(report, progress);
  progress.set_memory_bytes(ResidentBytes());
  return progress;
}

// Sets the fields of time. Updates the ETA with the step first.
void WorkerProgress::DescribeTimes(const StepReport& report, v1::JobProgress& progress) {
  const double now = Now();
  if (std::isfinite(report.share)) {
    eta_.Share(report.share, now);
  } else {
    eta_.Step(first_step_, report.step, report.num_steps, now);
  }
  *progress.mutable_elapsed() = ToProto(now - Seconds(stage_start_.time_since_epoch()));
  if (const auto left = eta_.StageSecondsLeft()) *progress.mutable_eta() = ToProto(*left);
  if (const auto left = eta_.SecondsLeft(now)) *progress.mutable_job_eta() = ToProto(*left);
  progress.set_stage_number(eta_.stage_number());
  if (eta_.stage_number() > 0) progress.set_num_stages(eta_.num_stages());
  const double since_last = Seconds(Clock::now() - last_event_);
  // Steps of another activity are counted from 0 again.
  const int64_t before = report.activity == activity_ ? last_step_ : 0;
  if (since_last > 0 && report.step > before) {
    progress.set_steps_per_second(static_cast<double>(report.step - before) / since_last);
  }
}

}  // namespace pepeseg
