// The verbs "watch", "cancel" and "jobs".
#include "clients/cli/jobs.h"

#include <map>
#include <memory>
#include <set>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "clients/cli/failure.h"
#include "clients/cli/model_summary.h"
#include "clients/cli/progress_line.h"
#include "clients/cli/shell.h"
#include "clients/cli/text_table.h"
#include "clients/cpp/resource_names.h"
#include "clients/cpp/status_macros.h"

namespace pepeseg::client::cli {
namespace {

// Returns "reconstruct done in 12.3 s  METRIC VALUE", or "sfm         skipped: given".
std::string StageEndedText(const v1::JobEvent::StageEnded& ended) {
  const std::string stage = WordOf(ended.stage());
  std::string text =
      ended.skipped().empty()
          ? absl::StrFormat("%-11s done in %.1f s", stage, SecondsOf(ended.elapsed()))
          : absl::StrFormat("%-11s skipped: %s", stage, ended.skipped());
  for (const auto& [name, value] : ended.metrics()) {
    absl::StrAppendFormat(&text, "  %s %.4g", name, value);
  }
  return text;
}

// Returns "reconstruct depth skipped: REASON, from step 1200 on; saves 300 steps, about 4.5 s".
std::string TermSkippedText(const v1::JobEvent::TermSkipped& skipped) {
  std::string text = absl::StrFormat("%-11s %s skipped: %s", WordOf(skipped.stage()),
                                     WordOf(skipped.term()), skipped.reason());
  if (skipped.step() > 0) absl::StrAppendFormat(&text, ", from step %d on", skipped.step());
  if (skipped.saved_steps() > 0) {
    absl::StrAppendFormat(&text, "; saves %d steps, about %.1f s", skipped.saved_steps(),
                          SecondsOf(skipped.saved()));
  }
  return text;
}

// Shows an event on standard error.
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

// Returns an error unless the job succeeded.
absl::Status Outcome(const v1::Job& job) {
  const std::string word = WordOf(job.stage());
  const std::string stage = word.empty() ? "" : absl::StrCat(" in stage ", word);
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

absl::Status RunCancel(const Shell& shell, const std::string& job) {
  const Client client(shell.channel);
  ASSIGN_OR_RETURN(const v1::Job answer, client.CancelJob(job));
  shell.json ? PrintJson(answer) : Print(absl::StrCat(answer.name(), ": cancellation requested"));
  return absl::OkStatus();
}

// Returns the model of a job that succeeded, the progress of a running one, or the stage and the
// reason of another end.
std::string OutcomeText(const v1::Job& job) {
  if (!job.model().empty()) return job.model();
  const v1::JobProgress& progress = job.progress();
  if (job.state() == v1::JOB_STATE_RUNNING && job.has_progress()) {
    constexpr size_t kColumns = 60;
    return ProgressText(progress, kColumns);
  }
  const std::string word = WordOf(job.stage());
  const std::string stage = word.empty() ? "" : absl::StrCat("in ", word);
  if (job.state() != v1::JOB_STATE_FAILED) return stage;
  return absl::StrCat(stage, stage.empty() ? "" : ": ", job.error().message());
}

// `sizes`: bytes of models by name.
TableRow RowOf(const v1::Job& job, const std::map<std::string, int64_t>& sizes, absl::Time now) {
  const absl::Time end = job.has_end_time() ? ToTime(job.end_time()) : now;
  const auto size = sizes.find(job.model());
  return {job.name(),
          WordOf(job.state()),
          job.scene().substr(job.scene().find('/') + 1),
          AgeText(job.create_time(), now),
          job.has_start_time() ? SpanText(end - ToTime(job.start_time())) : "-",
          size == sizes.end() ? "-" : SizeText(size->second),
          OutcomeText(job)};
}

// Returns the bytes of the models that `jobs` have made and that still exist, by name.
std::map<std::string, int64_t> SizesOfModels(const Client& client,
                                             const v1::ListJobsResponse& jobs) {
  std::set<std::string> scenes;
  for (const v1::Job& job : jobs.jobs()) {
    if (!job.model().empty()) scenes.insert(job.scene());
  }
  std::map<std::string, int64_t> sizes;
  for (const std::string& scene : scenes) {
    const auto models = client.ListModels(scene);
    if (!models.ok()) continue;  // the scene was deleted in between
    for (const v1::Model& model : models->models()) sizes[model.name()] = model.num_bytes();
  }
  return sizes;
}

absl::Status RunJobs(const Shell& shell, const std::string& scene) {
  const Client client(shell.channel);
  ASSIGN_OR_RETURN(const auto all, client.ListJobs(scene));
  if (shell.json) {
    PrintJson(all);
    return absl::OkStatus();
  }
  const std::map<std::string, int64_t> sizes = SizesOfModels(client, all);
  std::vector<TableRow> rows = {{"JOB", "STATE", "SCENE", "AGE", "TOOK", "SIZE", "RESULT"}};
  for (const v1::Job& job : all.jobs()) rows.push_back(RowOf(job, sizes, absl::Now()));
  for (const std::string& line : TextTable(rows)) Print(line);
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<v1::Job> WatchJob(const Client& client, const std::string& job, EventFn on_event) {
  ProgressLine line;
  const auto show = [&](const v1::JobEvent& event) {
    ShowEvent(event, line);
    on_event(event);
  };
  ASSIGN_OR_RETURN(const v1::Job ended, client.WatchJob(job, show, [&] {
    line.Say("the connection to the server was lost; trying again");
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

void AddCancel(CLI::App& app, Shell& shell) {
  auto job = std::make_shared<std::string>();
  CLI::App* verb = app.add_subcommand("cancel", "Stop a job");
  verb->add_option("JOB", *job, "Name of the job")->required();
  verb->callback([job, &shell] { shell.verb = [&, job] { return RunCancel(shell, *job); }; });
}

void AddJobs(CLI::App& app, Shell& shell) {
  auto scene = std::make_shared<std::string>();
  CLI::App* verb = app.add_subcommand("jobs", "List jobs, newest first");
  verb->add_option("SCENE", *scene, "Only of this scene");
  verb->callback([scene, &shell] { shell.verb = [&, scene] { return RunJobs(shell, *scene); }; });
}

}  // namespace pepeseg::client::cli
