#include "clients/cli/watch.h"

#include <chrono>
#include <memory>
#include <optional>
#include <thread>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "clients/cli/failure.h"
#include "clients/cli/model_sources.h"
#include "clients/cli/progress_line.h"
#include "clients/cli/score_table.h"
#include "clients/cli/shell.h"
#include "clients/cli/status_macros.h"

namespace pepeseg::cli {
namespace {

constexpr int kRetries = 10;
constexpr auto kRetryPause = std::chrono::seconds(3);

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

bool HasEnded(v1::JobState state) {
  return state == v1::JOB_STATE_SUCCEEDED || state == v1::JOB_STATE_FAILED ||
         state == v1::JOB_STATE_CANCELLED;
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

struct Watched {
  std::optional<int64_t> sequence;  // of the last event seen
  bool ended = false;
};

// One stream, to its end.
absl::Status WatchOnce(const Connection& connection, const std::string& job, Watched& watched,
                       absl::FunctionRef<void(const v1::JobEvent&)> on_event) {
  v1::WatchJobRequest request;
  request.set_name(job);
  if (watched.sequence) request.set_after_sequence(*watched.sequence);
  Call call("", 0);
  auto stream = connection.jobs->WatchJob(call, request);
  v1::JobEvent event;
  while (stream->Read(&event)) {
    watched.sequence = event.sequence();
    if (event.event_case() == v1::JobEvent::kHeartbeat) continue;
    watched.ended |= event.event_case() == v1::JobEvent::kStateChanged &&
                     HasEnded(event.state_changed().state());
    watched.ended |=
        event.event_case() == v1::JobEvent::kSnapshot && HasEnded(event.snapshot().state());
    on_event(event);
  }
  return FromGrpc(stream->Finish());
}

absl::Status Outcome(const v1::Job& job) {
  if (job.state() == v1::JOB_STATE_FAILED) {
    return JobFailed(absl::StrCat(job.name(), " failed: ", job.error().message()));
  }
  if (job.state() == v1::JOB_STATE_CANCELLED) {
    return JobCancelled(absl::StrCat(job.name(), " was cancelled"));
  }
  return absl::OkStatus();
}

struct WatchFlags {
  std::string job;
};

absl::Status RunWatch(const Shell& shell, const WatchFlags& flags) {
  const Connection connection(shell.channel);
  const auto job = WatchJob(connection, JobName(flags.job), [&](const v1::JobEvent& event) {
    if (shell.json) PrintJson(event);
  });
  RETURN_IF_ERROR(job.status());
  if (shell.json) return absl::OkStatus();
  Print(absl::StrCat(job->name(), " succeeded: ", job->model()));
  RETURN_IF_ERROR(PrintSources(connection, job->model()));
  return PrintScores(connection, job->model());
}

}  // namespace

absl::StatusOr<v1::Job> WatchJob(const Connection& connection, const std::string& job,
                                 EventFn on_event) {
  ProgressLine line;
  Watched watched;
  for (int failures = 0; !watched.ended;) {
    const std::optional<int64_t> before = watched.sequence;
    const absl::Status status = WatchOnce(connection, job, watched, [&](const v1::JobEvent& event) {
      ShowEvent(event, line);
      on_event(event);
    });
    if (watched.ended || status.ok()) break;
    if (watched.sequence != before) failures = 0;
    if (ExitCodeOf(status) != kNoServer || !watched.sequence || ++failures > kRetries) {
      return status;
    }
    line.Say("the server went away; asking again");
    std::this_thread::sleep_for(kRetryPause);
  }
  v1::GetJobRequest request;
  request.set_name(job);
  v1::Job ended;
  Call call("", kCallSeconds);
  RETURN_IF_ERROR(FromGrpc(connection.jobs->GetJob(call, request, &ended)));
  RETURN_IF_ERROR(Outcome(ended));
  return ended;
}

void AddWatch(CLI::App& app, Shell& shell) {
  auto flags = std::make_shared<WatchFlags>();
  CLI::App* verb = app.add_subcommand("watch", "Follow a job to its end");
  verb->add_option("JOB", flags->job, "Name of the job")->required();
  verb->callback([flags, &shell] { shell.verb = [&, flags] { return RunWatch(shell, *flags); }; });
}

}  // namespace pepeseg::cli
