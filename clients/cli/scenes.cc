// The verb "scenes": lists the scenes, describes or deletes one.
#include <memory>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/time/clock.h"
#include "clients/cli/model_summary.h"
#include "clients/cli/shell.h"
#include "clients/cli/text_table.h"
#include "clients/cpp/client.h"
#include "clients/cpp/resource_names.h"
#include "clients/cpp/status_macros.h"

namespace pepeseg::client::cli {
namespace {

struct ScenesFlags {
  std::string scene;    // "": list all
  bool remove = false;  // delete the scene
};

// Returns "shelf" for "scenes/shelf".
std::string IdOf(const std::string& name) { return name.substr(name.rfind('/') + 1); }

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
  if (const std::string sources = SourcesText(model); !sources.empty()) {
    Print("  trained on: " + sources);
  }
  for (const auto& [metric, value] : model.metrics()) {
    Print(absl::StrFormat("  %s %.4g", metric, value));
  }
  if (const std::string quality = MaskQualityText(model); !quality.empty()) Print("  " + quality);
  PrintAdvice(model);
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

}  // namespace pepeseg::client::cli
