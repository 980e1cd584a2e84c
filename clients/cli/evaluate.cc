// The verb that scores a model against label images.
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "clients/cli/evaluation.h"
#include "clients/cli/pixel_frame.h"
#include "clients/cli/shell.h"
#include "clients/cpp/file_bytes.h"
#include "clients/cpp/resource_names.h"
#include "clients/cpp/status_macros.h"

namespace pepeseg::client::cli {
namespace {

namespace fs = std::filesystem;

struct EvaluateFlags {
  std::string scene;
  std::string folder;
  std::string ignore;
  std::string names;
  std::string model = "live";
  double threshold = -2;                              // below -1: the server's default
  v1::PixelFrame frame = v1::PIXEL_FRAME_PHOTOGRAPH;  // of the label images and the ignore mask
};

// FOLDER/STEM.png of every held-out view that has one; the names of the others.
absl::StatusOr<std::vector<std::string>> AddLabels(const EvaluateFlags& flags,
                                                   const std::vector<v1::View>& views,
                                                   v1::EvaluateRequest& request) {
  std::string ignore;
  if (!flags.ignore.empty()) {
    ASSIGN_OR_RETURN(ignore, ReadFile(flags.ignore));
  }
  std::vector<std::string> without;
  for (const v1::View& view : views) {
    if (!view.held_out()) continue;
    const fs::path path = fs::path(flags.folder) / fs::path(view.view()).replace_extension(".png");
    std::error_code error;
    if (!fs::exists(path, error)) {
      without.push_back(path.filename().string());
      continue;
    }
    auto& labels = *request.add_labels();
    labels.set_view(view.view());
    ASSIGN_OR_RETURN(*labels.mutable_png(), ReadFile(path));
    labels.set_ignore_png(ignore);
  }
  if (request.labels().empty()) {
    const std::string wanted = without.empty() ? "no view is held out" : "no " + without.front();
    return LocalFileMissing(absl::StrCat(
        flags.folder, " has no label image of a held-out view: ", wanted, " or the like"));
  }
  return without;
}

// ["none", "apple", ...] by id, or {"7": "apple", ...}.
absl::Status AddNames(const std::string& file, v1::EvaluateRequest& request) {
  ASSIGN_OR_RETURN(const std::string text, ReadFile(file));
  const auto json = nlohmann::json::parse(text, nullptr, /*allow_exceptions=*/false);
  int index = 0;
  for (const auto& [key, name] : json.items()) {
    int id = index++;
    if (!name.is_string() || (json.is_object() && !absl::SimpleAtoi(key, &id))) {
      return absl::InvalidArgumentError(absl::StrCat(file, ": names by id are wanted; at ", key));
    }
    (*request.mutable_entity_names())[id] = name.get<std::string>();
  }
  if (index > 0) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat(file, ": neither a JSON array of names nor an object of them by id"));
}

absl::Status RunEvaluate(const Shell& shell, const EvaluateFlags& flags) {
  if (!fs::is_directory(flags.folder)) {
    return LocalFileMissing(absl::StrCat("no such folder: ", flags.folder));
  }
  const Client client(shell.channel);
  v1::EvaluateRequest request;
  request.set_model(absl::StrCat(SceneName(flags.scene), "/models/", flags.model));
  if (!flags.names.empty()) RETURN_IF_ERROR(AddNames(flags.names, request));
  request.set_frame(flags.frame);
  if (flags.threshold >= -1) request.mutable_options()->set_fixed_threshold(flags.threshold);
  ASSIGN_OR_RETURN(const std::vector<v1::View> views, client.ListViews(request.model()));
  ASSIGN_OR_RETURN(const std::vector<std::string> without, AddLabels(flags, views, request));
  if (!without.empty()) {
    Note(absl::StrCat(without.size(), " held-out views have no labels, as ", without.front()));
  }
  ASSIGN_OR_RETURN(const v1::EvaluateResponse answer, client.Evaluate(request));
  if (shell.json) {
    PrintJson(answer);
    return absl::OkStatus();
  }
  Print(absl::StrCat(answer.model(), ", one click each in the first held-out view that shows it"));
  for (const std::string& row : EvaluationTable(answer)) Print(row);
  return absl::OkStatus();
}

}  // namespace

void AddEvaluate(CLI::App& app, Shell& shell) {
  auto flags = std::make_shared<EvaluateFlags>();
  CLI::App* verb = app.add_subcommand("evaluate", "Score one click an entity against label images");
  verb->add_option("SCENE", flags->scene, "Id of the scene")->required();
  verb->add_option("LABELS_FOLDER", flags->folder,
                   "Label images named as the photographs, STEM.png: grey, 8 or 16 bits, an id a "
                   "pixel, 0 for none; those of views that were trained on are not read")
      ->required();
  verb->add_option("--ignore", flags->ignore,
                   "A PNG for all views: pixels that are not 0 are not scored");
  verb->add_option("--names", flags->names, "JSON file with the entities' names by id");
  verb->add_option("--threshold", flags->threshold, "Cosine of the fixed scales")
      ->check(CLI::Range(-1.0, 1.0));
  verb->add_option("--model", flags->model, "Number of the model")->capture_default_str();
  AddFrameFlag(*verb, flags->frame);
  verb->callback(
      [flags, &shell] { shell.verb = [&, flags] { return RunEvaluate(shell, *flags); }; });
}

}  // namespace pepeseg::client::cli
