// The verbs "scenes" and "models": list the scenes, or the models of one; describe or delete one.
#include <memory>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/time/clock.h"
#include "clients/cli/verbs.h"
#include "clients/cpp/client.h"
#include "clients/cpp/resource_names.h"
#include "clients/cpp/status_macros.h"
#include "clients/terminal/model_summary.h"
#include "clients/terminal/shell.h"
#include "clients/terminal/text_table.h"

namespace pepeseg::client::cli {
namespace {

// Returns "shelf" for "scenes/shelf", and "3" for "scenes/shelf/models/3".
std::string IdOf(const std::string& name) { return name.substr(name.rfind('/') + 1); }

// Prints the sources, metrics and advice of a model.
void PrintFacts(const v1::Model& model) {
  if (const std::string sources = SourcesText(model); !sources.empty()) {
    Print("  trained on: " + sources);
  }
  for (const auto& [metric, value] : model.metrics()) {
    Print(absl::StrFormat("  %s %.4g", metric, value));
  }
  if (const std::string quality = MaskQualityText(model); !quality.empty()) Print("  " + quality);
  PrintAdvice(model);
}

struct ScenesFlags {
  std::string scene;    // "": list all
  bool remove = false;  // delete the scene
};

// Returns the row of a scene; its size is that of all its models.
absl::StatusOr<TableRow> RowOf(const Client& client, const v1::Scene& scene) {
  ASSIGN_OR_RETURN(const v1::ListModelsResponse models, client.ListModels(scene.name()));
  int64_t num_bytes = 0;
  for (const v1::Model& model : models.models()) num_bytes += model.num_bytes();
  const std::string state = !scene.active_job().empty()  ? "training: " + scene.active_job()
                            : scene.live_model().empty() ? "no model yet"
                                                         : "trained";
  return TableRow{IdOf(scene.name()),
                  AgeText(scene.create_time(), absl::Now()),
                  absl::StrCat(models.models_size()),
                  SizeText(num_bytes),
                  scene.live_model().empty() ? "-" : scene.live_model(),
                  state};
}

// Prints a table of the scenes.
absl::Status ListScenes(const Shell& shell, const Client& client) {
  ASSIGN_OR_RETURN(const auto all, client.ListScenes());
  if (shell.json) {
    PrintJson(all);
    return absl::OkStatus();
  }
  std::vector<TableRow> rows = {{"SCENE", "AGE", "MODELS", "SIZE", "LIVE MODEL", "STATE"}};
  for (const v1::Scene& scene : all.scenes()) {
    absl::StatusOr<TableRow> row = RowOf(client, scene);
    if (absl::IsNotFound(row.status())) continue;  // the scene was deleted in between
    RETURN_IF_ERROR(row.status());
    rows.push_back(*std::move(row));
  }
  for (const std::string& line : TextTable(rows)) Print(line);
  return absl::OkStatus();
}

// Returns "scenes/shelf  scenes/shelf/models/2  training: jobs/j3".
std::string SceneLine(const v1::Scene& scene) {
  std::string line = absl::StrCat(scene.name(), "  ");
  absl::StrAppend(&line, scene.live_model().empty() ? "no model yet" : scene.live_model());
  if (!scene.active_job().empty()) absl::StrAppend(&line, "  training: ", scene.active_job());
  return line;
}

// Prints the scene, its live model with metrics and advice, and the model's views.
absl::Status DescribeScene(const Shell& shell, const Client& client, const std::string& name) {
  ASSIGN_OR_RETURN(const v1::Scene scene, client.GetScene(name));
  shell.json ? PrintJson(scene) : Print(SceneLine(scene));
  if (scene.live_model().empty()) return absl::OkStatus();
  ASSIGN_OR_RETURN(const v1::Model model, client.GetModel(scene.live_model()));
  ASSIGN_OR_RETURN(const std::vector<v1::View> views, client.ListViews(model.name()));
  if (shell.json) {
    PrintJson(model);
    for (const v1::View& view : views) PrintJson(view);
    return absl::OkStatus();
  }
  Print(absl::StrFormat("  %d Gaussians, %.1f MB", model.num_gaussians(),
                        static_cast<double>(model.num_bytes()) * 1e-6));
  PrintFacts(model);
  for (const v1::View& view : views) {
    Print(absl::StrFormat("  %s  %dx%d%s", view.view(), view.camera().width(),
                          view.camera().height(), view.held_out() ? "  held out" : ""));
  }
  return absl::OkStatus();
}

absl::Status RunScenes(const Shell& shell, const ScenesFlags& flags) {
  const Client client(shell.channel);
  if (flags.scene.empty()) return ListScenes(shell, client);
  if (flags.remove) return client.DeleteScene(flags.scene);
  return DescribeScene(shell, client, SceneName(flags.scene));
}

// Returns "corrected 1" or "edited 1: removed 1204 Gaussians and filled the hole"; "-": a training
// made the model.
std::string ChangeText(const v1::Model& model) {
  if (!model.edited_from().empty()) {
    return absl::StrCat("edited ", IdOf(model.edited_from()), ": ", model.edit());
  }
  if (!model.corrected_from().empty()) {
    return absl::StrCat("corrected ", IdOf(model.corrected_from()));
  }
  return "-";
}

struct ModelsFlags {
  std::string scene;
  int number = 0;       // of a model; 0: list all
  bool remove = false;  // delete the model
  bool live = false;    // make it the live one
};

TableRow RowOf(const v1::Model& model, absl::Time now) {
  const auto psnr = model.metrics().find("psnr");
  return {IdOf(model.name()),
          AgeText(model.create_time(), now),
          SizeText(model.num_bytes()),
          absl::StrCat(model.num_gaussians()),
          psnr == model.metrics().end() ? "-" : absl::StrFormat("%.2f dB", psnr->second),
          model.job(),
          model.dataset().empty() ? "-" : IdOf(model.dataset()),
          SourcesText(model),
          ChangeText(model)};
}

// Prints a table of the models of a scene.
absl::Status ListModels(const Shell& shell, const Client& client, const std::string& scene) {
  ASSIGN_OR_RETURN(const v1::ListModelsResponse all, client.ListModels(scene));
  if (shell.json) {
    PrintJson(all);
    return absl::OkStatus();
  }
  std::vector<TableRow> rows = {
      {"MODEL", "AGE", "SIZE", "GAUSSIANS", "PSNR", "JOB", "DATASET", "TRAINED ON", "CHANGE"}};
  for (const v1::Model& model : all.models()) rows.push_back(RowOf(model, absl::Now()));
  for (const std::string& line : TextTable(rows)) Print(line);
  return absl::OkStatus();
}

// Prints a model with its sources, metrics and advice.
absl::Status DescribeModel(const Shell& shell, const Client& client, const std::string& name) {
  ASSIGN_OR_RETURN(const v1::Model model, client.GetModel(name));
  if (shell.json) {
    PrintJson(model);
    return absl::OkStatus();
  }
  Print(absl::StrFormat("%s  %d Gaussians, %s", model.name(), model.num_gaussians(),
                        SizeText(model.num_bytes())));
  if (!model.corrected_from().empty()) Print("  corrected from " + model.corrected_from());
  if (!model.edited_from().empty()) {
    Print(absl::StrCat("  edited from ", model.edited_from(), ": ", model.edit()));
  }
  PrintFacts(model);
  return absl::OkStatus();
}

absl::Status RunModels(const Shell& shell, const ModelsFlags& flags) {
  const Client client(shell.channel);
  if (flags.number == 0) return ListModels(shell, client, SceneName(flags.scene));
  const std::string name = ModelName(flags.scene, std::to_string(flags.number));
  if (flags.remove) return client.DeleteModel(name);
  if (!flags.live) return DescribeModel(shell, client, name);
  ASSIGN_OR_RETURN(const v1::Scene scene, client.SetLiveModel(name));
  shell.json ? PrintJson(scene) : Print(SceneLine(scene));
  return absl::OkStatus();
}

}  // namespace

void AddScenes(CLI::App& app, Shell& shell) {
  auto flags = std::make_shared<ScenesFlags>();
  CLI::App* verb = app.add_subcommand("scenes", "List scenes, or describe one");
  CLI::Option* scene = verb->add_option("SCENE", flags->scene,
                                        "Id of a scene to describe: its model, metrics and views");
  verb->add_flag("--delete", flags->remove, "Delete the scene with its datasets, jobs and models")
      ->needs(scene);
  verb->callback([flags, &shell] { shell.verb = [&, flags] { return RunScenes(shell, *flags); }; });
}

void AddModels(CLI::App& app, Shell& shell) {
  auto flags = std::make_shared<ModelsFlags>();
  CLI::App* verb =
      app.add_subcommand("models",
                         "List a scene's models, newest first; describe one, delete it "
                         "or make it the live one");
  verb->add_option("SCENE", flags->scene, "Id of the scene")->required();
  CLI::Option* number =
      verb->add_option("NUMBER", flags->number, "Number of a model")->check(CLI::PositiveNumber);
  CLI::Option* remove =
      verb->add_flag("--delete", flags->remove,
                     "Delete the model with its selections; if it is the live one, the model that "
                     "was live before becomes it")
          ->needs(number);
  verb->add_flag("--live", flags->live,
                 "Make the model the live one: undoes a correction or an edit")
      ->needs(number)
      ->excludes(remove);
  verb->callback([flags, &shell] { shell.verb = [&, flags] { return RunModels(shell, *flags); }; });
}

}  // namespace pepeseg::client::cli
