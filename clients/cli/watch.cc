#include "clients/cli/watch.h"

#include <memory>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "clients/cli/failure.h"
#include "clients/cli/progress_line.h"
#include "clients/cli/shell.h"
#include "clients/cli/trained_model.h"
#include "clients/cpp/resource_names.h"
#include "clients/cpp/status_macros.h"

namespace pepeseg::client::cli {
namespace {

double Seconds(const google::protobuf::Duration& duration) {
  return static_cast<double>(duration.seconds()) + static_cast<double>(duration.nanos()) * 1e-9;
}

std::string StageEndedText(const v1::JobEvent::StageEnded& ended) {
  std::string text =
      ended.skipped().empty()
          ? absl::StrFormat("%-11s done in %.1f s", ended.stage(), Seconds(ended.elapsed()))
          : absl::StrFormat("%-11s skipped: %s", ended.stage(), ended.skipped());
  for (const auto& [name, value] : ended.metrics()) {
    absl::StrAppendFormat(&text, "  %s %.4g", name, value);
  }
  return text;
}

std::string TermSkippedText(const v1::JobEvent::TermSkipped& skipped) {
  std::string text =
      absl::StrFormat("%-11s %s skipped: %s", skipped.stage(), skipped.term(), skipped.reason());
  if (skipped.step() > 0) absl::StrAppendFormat(&text, ", from step %d on", skipped.step());
  if (skipped.saved_steps() > 0) {
    absl::StrAppendFormat(&text, "; saves %d steps, about %.1f s", skipped.saved_steps(),
                          Seconds(skipped.saved()));
  }
  return text;
}

void ShowEvent(const v1::JobEvent& event, ProgressLine& line) {
  switch (event.event_case()) {
    case v1::JobEvent::kSnapshot:
      if (event.snapshot().state() == v1::JOB_STATE_QUEUED) line.Say("queued");
      if (event.snapshot().has_progress()) {
        line.Show(ProgressText(event.snapshot().progress(), line.columns()));
      }
      break;
    case v1::JobEvent::kProgress: {
      const v1::JobProgress& progress = event.progress();
      line.Show(ProgressText(progress, line.columns()), progress.step() >= progress.num_steps());
      break;
    }
    case v1::JobEvent::kStageEnded:
      line.Say(StageEndedText(event.stage_ended()));
      break;
    case v1::JobEvent::kTermSkipped:
      line.Say(TermSkippedText(event.term_skipped()));
      break;
    case v1::JobEvent::kWarning:
      line.Say("warning: " + event.warning().message());
      break;
    default:
      break;
  }
}

absl::Status Outcome(const v1::Job& job) {
  const std::string stage = job.stage().empty() ? "" : absl::StrCat(" in stage ", job.stage());
  if (job.state() == v1::JOB_STATE_FAILED) {
    return JobFailed(absl::StrCat(job.name(), " failed", stage, ": ", job.error().message()));
  }
  if (job.state() == v1::JOB_STATE_CANCELLED) {
    return JobCancelled(absl::StrCat(job.name(), " was cancelled", stage));
  }
  return absl::OkStatus();
}

struct WatchFlags {
  std::string job;
};

absl::Status RunWatch(const Shell& shell, const WatchFlags& flags) {
  const Client client(shell.channel);
  const auto job = WatchJob(client, JobName(flags.job), [&](const v1::JobEvent& event) {
    if (shell.json) PrintJson(event);
  });
  RETURN_IF_ERROR(job.status());
  if (shell.json) return absl::OkStatus();
  Print(absl::StrCat(job->name(), " succeeded: ", job->model()));
  return PrintTrained(shell, client, job->model());
}

}  // namespace

absl::StatusOr<v1::Job> WatchJob(const Client& client, const std::string& job, EventFn on_event) {
  ProgressLine line;
  const auto show = [&](const v1::JobEvent& event) {
    ShowEvent(event, line);
    on_event(event);
  };
  ASSIGN_OR_RETURN(const v1::Job ended, client.WatchJob(job, show, [&] {
    line.Say("the server went away; asking again");
  }));
  RETURN_IF_ERROR(Outcome(ended));
  return ended;
}

void AddWatch(CLI::App& app, Shell& shell) {
  auto flags = std::make_shared<WatchFlags>();
  CLI::App* verb = app.add_subcommand("watch", "Follow a job to its end");
  verb->add_option("JOB", flags->job, "Name of the job")->required();
  verb->callback([flags, &shell] { shell.verb = [&, flags] { return RunWatch(shell, *flags); }; });
}

}  // namespace pepeseg::client::cli
