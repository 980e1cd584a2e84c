// The verb that lists scenes and their live models.
#include <memory>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "clients/cli/all_pages.h"
#include "clients/cli/connection.h"
#include "clients/cli/failure.h"
#include "clients/cli/model_sources.h"
#include "clients/cli/shell.h"
#include "clients/cli/status_macros.h"

namespace pepeseg::cli {
namespace {

struct ScenesFlags {
  std::string scene;
  bool remove = false;
};

std::string SceneLine(const v1::Scene& scene) {
  std::string line = absl::StrFormat("%-32s", scene.name());
  absl::StrAppend(&line, scene.live_model().empty() ? "no model yet" : scene.live_model());
  if (!scene.active_job().empty()) absl::StrAppend(&line, "  training: ", scene.active_job());
  return line;
}

absl::Status ListScenes(const Shell& shell, const Connection& connection) {
  v1::ListScenesRequest request;
  ASSIGN_OR_RETURN(const auto all, AllPages<v1::ListScenesResponse>(
                                       request, "", [&](Call& call, const auto& asked, auto* page) {
                                         return connection.scenes->ListScenes(call, asked, page);
                                       }));
  if (shell.json) {
    PrintJson(all);
  } else {
    for (const v1::Scene& scene : all.scenes()) Print(SceneLine(scene));
  }
  return absl::OkStatus();
}

// The scene's live model with what was measured of it, and its views.
absl::Status DescribeScene(const Shell& shell, const Connection& connection,
                           const std::string& name) {
  v1::GetSceneRequest request;
  request.set_name(name);
  v1::Scene scene;
  Call call(name, kCallSeconds);
  RETURN_IF_ERROR(FromGrpc(connection.scenes->GetScene(call, request, &scene)));
  shell.json ? PrintJson(scene) : Print(SceneLine(scene));
  if (scene.live_model().empty()) return absl::OkStatus();
  v1::GetModelRequest model_request;
  model_request.set_name(scene.live_model());
  v1::Model model;
  Call model_call(name, kCallSeconds);
  RETURN_IF_ERROR(FromGrpc(connection.scenes->GetModel(model_call, model_request, &model)));
  ASSIGN_OR_RETURN(const std::vector<v1::View> views, AllViews(connection, model.name()));
  if (shell.json) {
    PrintJson(model);
    for (const v1::View& view : views) PrintJson(view);
    return absl::OkStatus();
  }
  Print(absl::StrFormat("  %d Gaussians, %.1f MB", model.num_gaussians(),
                        static_cast<double>(model.num_bytes()) * 1e-6));
  if (model.sources_size() > 0) Print("  trained on: " + SourcesText(model));
  for (const auto& [metric, value] : model.metrics()) {
    Print(absl::StrFormat("  %s %.4g", metric, value));
  }
  for (const v1::View& view : views) {
    Print(absl::StrFormat("  %s  %dx%d%s", view.view(), view.camera().width(),
                          view.camera().height(), view.held_out() ? "  held out" : ""));
  }
  return absl::OkStatus();
}

absl::Status RemoveScene(const Connection& connection, const std::string& name) {
  v1::DeleteSceneRequest request;
  request.set_name(name);
  google::protobuf::Empty answer;
  Call call(name, kCallSeconds);
  return FromGrpc(connection.scenes->DeleteScene(call, request, &answer));
}

absl::Status RunScenes(const Shell& shell, const ScenesFlags& flags) {
  const Connection connection(shell.channel);
  if (flags.scene.empty()) return ListScenes(shell, connection);
  if (flags.remove) return RemoveScene(connection, SceneName(flags.scene));
  return DescribeScene(shell, connection, SceneName(flags.scene));
}

}  // namespace

void AddScenes(CLI::App& app, Shell& shell) {
  auto flags = std::make_shared<ScenesFlags>();
  CLI::App* verb = app.add_subcommand("scenes", "List scenes, or describe one");
  CLI::Option* scene = verb->add_option("SCENE", flags->scene, "Its model, metrics and views");
  verb->add_flag("--delete", flags->remove, "Delete the scene with all that belongs to it")
      ->needs(scene);
  verb->callback([flags, &shell] { shell.verb = [&, flags] { return RunScenes(shell, *flags); }; });
}

}  // namespace pepeseg::cli
