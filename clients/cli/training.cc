// Verbs on jobs: train, cancel, jobs.
#include "clients/cli/training.h"

#include <map>
#include <memory>
#include <set>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "clients/cli/failure.h"
#include "clients/cli/option_table.h"
#include "clients/cli/progress_line.h"
#include "clients/cli/shell.h"
#include "clients/cli/text_table.h"
#include "clients/cli/trained_model.h"
#include "clients/cli/watch.h"
#include "clients/cpp/client.h"
#include "clients/cpp/option_setting.h"
#include "clients/cpp/resource_names.h"
#include "clients/cpp/status_macros.h"

namespace pepeseg::client::cli {
namespace {

struct TrainFlags : TrainingFlags {
  bool detach = false;
  bool list_options = false;
};

absl::Status RunTrain(const Shell& shell, const TrainFlags& flags) {
  if (flags.list_options) {
    for (const std::string& line : OptionTable()) Print(line);
    return absl::OkStatus();
  }
  const Client client(shell.channel);
  const std::string scene = SceneName(flags.scene);
  ASSIGN_OR_RETURN(const std::string dataset, DatasetName(client, scene, flags.dataset));
  ASSIGN_OR_RETURN(const v1::Job job, StartTraining(client, scene, dataset, Settings(flags)));
  if (flags.detach) {
    shell.json ? PrintJson(job) : Print(job.name());
    return absl::OkStatus();
  }
  Note(job.name());
  ASSIGN_OR_RETURN(const v1::Job ended,
                   WatchJob(client, job.name(), [](const v1::JobEvent& /*event*/) {}));
  if (shell.json) {
    PrintJson(ended);
    return absl::OkStatus();
  }
  Print(absl::StrCat("trained: ", ended.model()));
  return PrintTrained(shell, client, ended.model());
}

absl::Status RunCancel(const Shell& shell, const std::string& job) {
  const Client client(shell.channel);
  ASSIGN_OR_RETURN(const v1::Job answer, client.CancelJob(job));
  shell.json ? PrintJson(answer) : Print(absl::StrCat(answer.name(), ": told to stop"));
  return absl::OkStatus();
}

std::string WordOf(v1::JobState state) {
  constexpr size_t kPrefix = sizeof("JOB_STATE_") - 1;
  return absl::AsciiStrToLower(v1::JobState_Name(state).substr(kPrefix));
}

// The model, how far it is, or where and why it ended.
std::string OutcomeText(const v1::Job& job) {
  if (!job.model().empty()) return job.model();
  const v1::JobProgress& progress = job.progress();
  if (job.state() == v1::JOB_STATE_RUNNING && job.has_progress()) {
    constexpr size_t kColumns = 60;
    return ProgressText(progress, kColumns);
  }
  const std::string stage = job.stage().empty() ? "" : absl::StrCat("in ", job.stage());
  if (job.state() != v1::JOB_STATE_FAILED) return stage;
  return absl::StrCat(stage, stage.empty() ? "" : ": ", job.error().message());
}

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

// Returns the bytes of the models that `jobs` have made, by name, without deleted models.
std::map<std::string, int64_t> SizesOfModels(const Client& client,
                                             const v1::ListJobsResponse& jobs) {
  std::set<std::string> scenes;
  for (const v1::Job& job : jobs.jobs()) {
    if (!job.model().empty()) scenes.insert(job.scene());
  }
  std::map<std::string, int64_t> sizes;
  for (const std::string& scene : scenes) {
    const auto models = client.ListModels(scene);
    if (!models.ok()) continue;  // the scene was deleted meanwhile
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

std::vector<std::string> Settings(const TrainingFlags& flags) {
  std::vector<std::string> settings;
  if (!flags.preset.empty()) settings.push_back("preset=" + flags.preset);
  if (!flags.steps.empty()) settings.push_back("reconstruct.num_steps=" + flags.steps);
  if (!flags.feature_steps.empty()) settings.push_back("features.num_steps=" + flags.feature_steps);
  if (!flags.image_scale.empty()) settings.push_back("import.image_scale=" + flags.image_scale);
  settings.insert(settings.end(), flags.settings.begin(), flags.settings.end());
  return settings;
}

absl::StatusOr<std::string> DatasetName(const Client& client, const std::string& scene,
                                        const std::string& dataset) {
  if (absl::StrContains(dataset, "/")) return dataset;
  if (!dataset.empty()) return absl::StrCat(scene, "/datasets/", dataset);
  ASSIGN_OR_RETURN(const v1::Dataset newest, client.NewestDataset(scene));
  return newest.name();
}

absl::StatusOr<v1::Job> StartTraining(const Client& client, const std::string& scene,
                                      const std::string& dataset,
                                      const std::vector<std::string>& settings) {
  v1::TrainSceneRequest request;
  request.set_scene(scene);
  request.set_dataset(dataset);
  for (const std::string& setting : settings) {
    RETURN_IF_ERROR(SetOption(setting, *request.mutable_options()));
  }
  return client.Train(std::move(request));
}

void AddTrainingFlags(CLI::App& verb, TrainingFlags& flags) {
  verb.add_option("SCENE", flags.scene, "Id of the scene")->required();
  verb.add_option("--dataset", flags.dataset, "Number of the dataset; the newest by default");
  verb.add_option("--preset", flags.preset,
                  "What options that are not given are taken from: preview, as soon as there is "
                  "something to click on; standard, the defaults; best, however long it takes")
      ->check(CLI::IsMember({"preview", "standard", "best"}));
  verb.add_option("--steps", flags.steps, "Steps of the reconstruction");
  verb.add_option("--feature-steps", flags.feature_steps, "Steps of the feature training");
  verb.add_option("--image-scale", flags.image_scale, "Shrink the photographs by this, (0, 1]");
  verb.add_option("-o,--option", flags.settings,
                  "NAME=VALUE, any option: `pepeseg train SCENE --list-options` shows them")
      ->type_name("NAME=VALUE")
      ->allow_extra_args(false);
}

void AddTrain(CLI::App& app, Shell& shell) {
  auto flags = std::make_shared<TrainFlags>();
  CLI::App* verb = app.add_subcommand("train", "Make a model of a scene");
  AddTrainingFlags(*verb, *flags);
  verb->add_flag("--list-options", flags->list_options,
                 "Only show the options with their defaults and ranges");
  verb->add_flag("--detach", flags->detach, "Print the job's name and leave");
  verb->callback([flags, &shell] { shell.verb = [&, flags] { return RunTrain(shell, *flags); }; });
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
