// The verbs "watch", "cancel" and "jobs".
#include <map>
#include <memory>
#include <set>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "clients/cli/verbs.h"
#include "clients/cpp/resource_names.h"
#include "clients/cpp/status_macros.h"
#include "clients/terminal/model_summary.h"
#include "clients/terminal/progress_line.h"
#include "clients/terminal/shell.h"
#include "clients/terminal/text_table.h"
#include "clients/terminal/training_run.h"

namespace pepeseg::client::cli {
namespace {

struct WatchFlags {
  std::string job;
  std::string previews;  // folder; empty: none
};

absl::Status RunWatch(const Shell& shell, const WatchFlags& flags) {
  const Client client(shell.channel);
  const auto print = [&](const v1::JobEvent& event) {
    if (shell.json) PrintJson(event);
  };
  const auto job = WatchJob(client, JobName(flags.job), print, flags.previews);
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

// Returns the model of a job that succeeded, the progress of a running one, what a queued one waits
// for, or the stage and the reason of another end.
std::string OutcomeText(const v1::Job& job) {
  if (!job.model().empty()) return job.model();
  const v1::JobProgress& progress = job.progress();
  if (job.state() == v1::JOB_STATE_RUNNING && job.has_progress()) {
    constexpr size_t kColumns = 60;
    return ProgressText(progress, kColumns);
  }
  if (job.has_wait()) return WaitText(job.wait(), absl::Now());
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

void AddWatch(CLI::App& app, Shell& shell) {
  auto flags = std::make_shared<WatchFlags>();
  CLI::App* verb = app.add_subcommand("watch", "Follow a job to its end");
  verb->add_option("JOB", flags->job, "Name of the job")->required();
  AddPreviewsFlag(*verb, flags->previews);
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
