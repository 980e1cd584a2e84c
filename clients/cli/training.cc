// Verbs on jobs: train, cancel, jobs.
#include "clients/cli/training.h"

#include <memory>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/time/time.h"
#include "clients/cli/failure.h"
#include "clients/cli/model_sources.h"
#include "clients/cli/score_table.h"
#include "clients/cli/shell.h"
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
    Print(absl::StrJoin(OptionNames(v1::TrainingOptions()), "\n"));
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
  RETURN_IF_ERROR(PrintSources(client, ended.model()));
  return PrintScores(client, ended.model());
}

absl::Status RunCancel(const Shell& shell, const std::string& job) {
  const Client client(shell.channel);
  ASSIGN_OR_RETURN(const v1::Job answer, client.CancelJob(job));
  shell.json ? PrintJson(answer) : Print(absl::StrCat(answer.name(), ": told to stop"));
  return absl::OkStatus();
}

std::string JobLine(const v1::Job& job) {
  const std::string state = v1::JobState_Name(job.state()).substr(10);
  std::string line = absl::StrFormat("%-28s %-10s %-24s", job.name(), state, job.scene());
  if (job.state() == v1::JOB_STATE_RUNNING && job.has_progress()) {
    absl::StrAppendFormat(&line, " %s %d/%d", job.stage(), job.progress().step(),
                          job.progress().num_steps());
  }
  if (job.state() == v1::JOB_STATE_FAILED) absl::StrAppend(&line, " ", job.error().message());
  if (!job.model().empty()) absl::StrAppend(&line, " ", job.model());
  return line;
}

absl::Status RunJobs(const Shell& shell, const std::string& scene) {
  const Client client(shell.channel);
  ASSIGN_OR_RETURN(const auto all, client.ListJobs(scene));
  if (shell.json) {
    PrintJson(all);
  } else {
    for (const v1::Job& job : all.jobs()) Print(JobLine(job));
  }
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
                  "NAME=VALUE, any option: see `pepeseg train x --list-options`")
      ->type_name("NAME=VALUE")
      ->allow_extra_args(false);
}

void AddTrain(CLI::App& app, Shell& shell) {
  auto flags = std::make_shared<TrainFlags>();
  CLI::App* verb = app.add_subcommand("train", "Make a model of a scene");
  AddTrainingFlags(*verb, *flags);
  verb->add_flag("--list-options", flags->list_options, "Only tell which options there are");
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
