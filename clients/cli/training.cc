// The verbs "train" and "estimate".
#include <memory>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "clients/cli/verbs.h"
#include "clients/cpp/client.h"
#include "clients/cpp/file_bytes.h"
#include "clients/cpp/option_setting.h"
#include "clients/cpp/resource_names.h"
#include "clients/cpp/status_macros.h"
#include "clients/terminal/flags.h"
#include "clients/terminal/model_summary.h"
#include "clients/terminal/shell.h"
#include "clients/terminal/text_table.h"
#include "clients/terminal/training_run.h"

namespace pepeseg::client::cli {
namespace {

// Flags of the verbs that train or estimate a training. "": not given.
struct TrainingFlags {
  std::string scene;
  std::string dataset;                // number or name
  std::vector<std::string> settings;  // NAME=VALUE, see SetOption
  std::string preset;
  std::string steps;                        // short for reconstruct.num_steps
  std::string feature_steps;                // short for features.num_steps
  std::string image_scale;                  // short for import.image_scale
  std::vector<std::string> held_out_views;  // names of photographs, for import.held_out_views
};

// Returns all options of the flags as NAME=VALUE, in the order in which they are to be set:
// `settings` come last and win.
std::vector<std::string> Settings(const TrainingFlags& flags) {
  std::vector<std::string> settings;
  if (!flags.preset.empty()) settings.push_back("preset=" + flags.preset);
  if (!flags.steps.empty()) settings.push_back("reconstruct.num_steps=" + flags.steps);
  if (!flags.feature_steps.empty()) settings.push_back("features.num_steps=" + flags.feature_steps);
  if (!flags.image_scale.empty()) settings.push_back("import.image_scale=" + flags.image_scale);
  for (const std::string& view : flags.held_out_views) {
    settings.push_back("import.held_out_views=" + view);
  }
  settings.insert(settings.end(), flags.settings.begin(), flags.settings.end());
  return settings;
}

// Returns the resource name of a dataset given by number or name ("2": "scenes/shelf/datasets/2"),
// or of the newest one for "". FAILED_PRECONDITION: the scene has no dataset.
absl::StatusOr<std::string> DatasetName(const Client& client, const std::string& scene,
                                        const std::string& dataset) {
  if (absl::StrContains(dataset, "/")) return dataset;
  if (!dataset.empty()) return absl::StrCat(scene, "/datasets/", dataset);
  ASSIGN_OR_RETURN(const v1::Dataset newest, client.NewestDataset(scene));
  return newest.name();
}

void AddTrainingFlags(CLI::App& verb, TrainingFlags& flags) {
  verb.add_option("SCENE", flags.scene, "Id of the scene")->required();
  verb.add_option("--dataset", flags.dataset, "Number of the dataset; the newest by default");
  verb.add_option("--preset", flags.preset,
                  "Values of the options that are not given: preview, a first model as soon as "
                  "possible; standard, the defaults; best, the best model, however long it takes; "
                  "paper, the recipe of PePESeg3D as printed, to compare with")
      ->check(CLI::IsMember({"preview", "standard", "best", "paper"}));
  verb.add_option("--steps", flags.steps, "Number of steps of the reconstruction");
  verb.add_option("--feature-steps", flags.feature_steps,
                  "Number of steps of the feature training");
  verb.add_option("--image-scale", flags.image_scale,
                  "Factor by which the photographs are shrunk, (0, 1]");
  AddNamesFlag(verb, "--held-out-views", flags.held_out_views,
               "Photographs to hold out of training, in place of every n-th")
      ->allow_extra_args(false);
  verb.add_option("-o,--option", flags.settings,
                  "Any option; `pepeseg train --list-options` lists them")
      ->type_name("NAME=VALUE")
      ->allow_extra_args(false);
}

struct TrainFlags : TrainingFlags {
  bool detach = false;        // do not wait for the end of the job
  bool list_options = false;  // print the options and train nothing
  std::string previews;       // folder; empty: none
};

// Prints each option of the server with its default and range, and below it what it does.
absl::Status ListOptions(const Shell& shell, const TrainFlags& flags) {
  v1::TrainingOptions preset;
  if (!flags.preset.empty()) RETURN_IF_ERROR(SetOption("preset=" + flags.preset, preset));
  v1::ListTrainingOptionsRequest request;
  if (preset.has_preset()) request.set_preset(preset.preset());
  ASSIGN_OR_RETURN(const v1::ListTrainingOptionsResponse response,
                   Client(shell.channel).ListTrainingOptions(request));
  if (shell.json) {
    PrintJson(response);
    return absl::OkStatus();
  }
  std::vector<TableRow> rows = {{"OPTION", "DEFAULT", "RANGE"}};
  for (const v1::TrainingOption& option : response.options()) {
    rows.push_back({option.name(), option.default_value(), option.range()});
  }
  const std::vector<std::string> lines = TextTable(rows);
  Print(lines.front());
  for (int i = 0; i < response.options_size(); ++i) {
    Print(lines[i + 1]);
    Print("    " + response.options(i).description());
  }
  return absl::OkStatus();
}

// Queues a training and follows it to its end. Standard output gets the result only: the job's name
// goes to standard error, unless it is the result (--detach).
absl::Status RunTrain(const Shell& shell, const TrainFlags& flags) {
  if (flags.list_options) return ListOptions(shell, flags);
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
                   WatchJob(
                       client, job.name(), [](const v1::JobEvent& /*event*/) {}, flags.previews));
  if (shell.json) {
    PrintJson(ended);
    return absl::OkStatus();
  }
  Print(absl::StrCat("trained: ", ended.model()));
  return PrintTrained(shell, client, ended.model());
}

// Prints the dataset, the memory of each stage, and whether the device has enough.
void PrintEstimate(const v1::EstimateTrainingResponse& estimate) {
  Print(absl::StrFormat("%d photographs of up to %.2f Mpx, %d points, %d files of masks",
                        estimate.num_views(), static_cast<double>(estimate.max_pixels()) * 1e-6,
                        estimate.num_points(), estimate.num_mask_files()));
  for (const auto& stage : estimate.stages()) {
    std::string line =
        absl::StrFormat("  %-12s device %8.0f MiB  host %8.0f MiB", WordOf(stage.stage()),
                        Mib(stage.device_bytes()), Mib(stage.host_bytes()));
    if (stage.has_duration()) absl::StrAppendFormat(&line, "  %d s", stage.duration().seconds());
    Print(line);
  }
  if (estimate.has_duration()) {
    Print(absl::StrFormat("takes about %d s", estimate.duration().seconds()));
  }
  const bool fits = estimate.need_bytes() <= estimate.have_bytes();
  Print(absl::StrFormat("needs up to %.0f MiB of %s; %.0f MiB are available: %s",
                        Mib(estimate.need_bytes()), estimate.device(), Mib(estimate.have_bytes()),
                        fits ? "it fits" : "it does not fit"));
}

absl::Status RunEstimate(const Shell& shell, const TrainingFlags& flags) {
  const Client client(shell.channel);
  v1::EstimateTrainingRequest request;
  request.set_scene(SceneName(flags.scene));
  ASSIGN_OR_RETURN(const std::string dataset, DatasetName(client, request.scene(), flags.dataset));
  request.set_dataset(dataset);
  for (const std::string& setting : Settings(flags)) {
    RETURN_IF_ERROR(SetOption(setting, *request.mutable_options()));
  }
  ASSIGN_OR_RETURN(const v1::EstimateTrainingResponse estimate, client.EstimateTraining(request));
  shell.json ? PrintJson(estimate) : PrintEstimate(estimate);
  return absl::OkStatus();
}

}  // namespace

void AddTrain(CLI::App& app, Shell& shell) {
  auto flags = std::make_shared<TrainFlags>();
  CLI::App* verb = app.add_subcommand("train", "Train a model of a scene");
  AddTrainingFlags(*verb, *flags);
  verb->get_option("SCENE")->required(false)->description("Id of the scene; for a training");
  verb->add_flag("--list-options", flags->list_options,
                 "List all options of the server with their defaults and ranges, and exit");
  verb->add_flag("--detach", flags->detach, "Print the name of the job and exit");
  AddPreviewsFlag(*verb, flags->previews);
  verb->callback([flags, &shell] {
    if (flags->scene.empty() && !flags->list_options) throw CLI::RequiredError("SCENE");
    shell.verb = [&, flags] { return RunTrain(shell, *flags); };
  });
}

void AddEstimate(CLI::App& app, Shell& shell) {
  auto flags = std::make_shared<TrainingFlags>();
  CLI::App* verb = app.add_subcommand("estimate", "Estimate the memory and time of a training");
  AddTrainingFlags(*verb, *flags);
  verb->callback(
      [flags, &shell] { shell.verb = [&, flags] { return RunEstimate(shell, *flags); }; });
}

}  // namespace pepeseg::client::cli
