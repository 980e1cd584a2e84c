// The verb "evaluate": scores a model against label images.
#include "clients/cli/evaluate.h"

#include <algorithm>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "clients/cli/request_flags.h"
#include "clients/cli/shell.h"
#include "clients/cpp/client.h"
#include "clients/cpp/file_bytes.h"
#include "clients/cpp/resource_names.h"
#include "clients/cpp/status_macros.h"

namespace pepeseg::client::cli {
namespace {

namespace fs = std::filesystem;

constexpr size_t kNameColumns = 40;  // longest name of an entity in the table

struct EvaluateFlags {
  std::string scene;
  std::string folder;  // of label images
  std::string ignore;  // a PNG; empty: none
  std::string names;   // a JSON file; empty: none
  std::string model = "live";
  double threshold = -2;                              // below -1: the server's default
  v1::PixelFrame frame = v1::PIXEL_FRAME_PHOTOGRAPH;  // of the label images and the ignore mask
};

// Adds FOLDER/STEM.png of every held-out view that has one, and returns the file names of the
// others. NOT_FOUND: no held-out view has a label image.
absl::StatusOr<std::vector<std::string>> AddLabels(const EvaluateFlags& flags,
                                                   const std::vector<v1::View>& views,
                                                   v1::EvaluateModelRequest& request) {
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
    const std::string reason =
        without.empty() ? "the model has no held-out view" : "expected " + without.front();
    return LocalFileMissing(
        absl::StrCat(flags.folder, " has no label image of a held-out view: ", reason));
  }
  return without;
}

// Reads the names of entities: ["none", "apple", ...] by id, or {"7": "apple", ...}.
absl::Status AddNames(const std::string& file, v1::EvaluateModelRequest& request) {
  ASSIGN_OR_RETURN(const std::string text, ReadFile(file));
  const auto json = nlohmann::json::parse(text, nullptr, /*allow_exceptions=*/false);
  int index = 0;
  for (const auto& [key, name] : json.items()) {
    int id = index++;
    if (!name.is_string() || (json.is_object() && !absl::SimpleAtoi(key, &id))) {
      return absl::InvalidArgumentError(
          absl::StrCat(file, ": the entry at ", key, " is not the name of an id"));
    }
    (*request.mutable_entity_names())[id] = name.get<std::string>();
  }
  if (index > 0) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat(file, ": expected a JSON array of names, or an object of names by id"));
}

absl::Status RunEvaluate(const Shell& shell, const EvaluateFlags& flags) {
  if (!fs::is_directory(flags.folder)) {
    return LocalFileMissing(absl::StrCat("no such folder: ", flags.folder));
  }
  const Client client(shell.channel);
  v1::EvaluateModelRequest request;
  request.set_model(absl::StrCat(SceneName(flags.scene), "/models/", flags.model));
  if (!flags.names.empty()) RETURN_IF_ERROR(AddNames(flags.names, request));
  request.set_frame(flags.frame);
  if (flags.threshold >= -1) request.mutable_options()->set_fixed_threshold(flags.threshold);
  ASSIGN_OR_RETURN(const std::vector<v1::View> views, client.ListViews(request.model()));
  ASSIGN_OR_RETURN(const std::vector<std::string> without, AddLabels(flags, views, request));
  if (!without.empty()) {
    Note(absl::StrCat(without.size(), " held-out views have no label image, such as ",
                      without.front()));
  }
  ASSIGN_OR_RETURN(const v1::EvaluateModelResponse answer, client.Evaluate(request));
  if (shell.json) {
    PrintJson(answer);
    return absl::OkStatus();
  }
  Print(absl::StrCat(answer.model(), ", one click each in the first held-out view that shows it"));
  for (const std::string& row : EvaluationTable(answer)) Print(row);
  return absl::OkStatus();
}

// Returns "48 chenille stems".
std::string NameOf(const v1::EvaluateModelResponse::Entity& entity) {
  std::string name = absl::StrCat(entity.id());
  if (!entity.name().empty()) absl::StrAppend(&name, " ", entity.name());
  return name.substr(0, kNameColumns);
}

std::string EntityRow(const v1::EvaluateModelResponse::Entity& entity, int columns) {
  std::string row =
      absl::StrFormat("%-*s  %5d  %5.3f  %5.3f", columns, NameOf(entity), entity.views_size() - 1,
                      entity.chosen().iou(), entity.chosen().boundary_iou());
  if (entity.missing()) {
    return absl::StrFormat("%s      -          -   %5.3f  nothing under the click", row,
                           entity.oracle().iou());
  }
  return absl::StrFormat("%s  %5.2f  %9.2f   %5.3f", row, entity.chosen().scale_quantile(),
                         entity.chosen().threshold(), entity.oracle().iou());
}

}  // namespace

std::vector<std::string> EvaluationTable(const v1::EvaluateModelResponse& answer) {
  const std::string last = absl::StrCat("mean of ", answer.entities_size());
  size_t widest = last.size();
  for (const auto& entity : answer.entities()) widest = std::max(widest, NameOf(entity).size());
  const int columns = static_cast<int>(widest);
  std::vector<std::string> rows = {
      absl::StrFormat("%-*s  views    IoU   BIoU  scale  threshold  oracle", columns, "entity")};
  for (const auto& entity : answer.entities()) rows.push_back(EntityRow(entity, columns));
  rows.push_back(absl::StrFormat("%-*s         %5.3f  %5.3f                     %5.3f", columns,
                                 last, answer.chosen().iou(), answer.chosen().boundary_iou(),
                                 answer.oracle().iou()));
  if (answer.left_out_size() > 0) {
    rows.push_back(absl::StrCat("left out, in fewer than two held-out views: ",
                                absl::StrJoin(answer.left_out(), ", ")));
  }
  std::string scales =
      absl::StrFormat("fixed scale, threshold %.2f", answer.options().fixed_threshold());
  std::string means = absl::StrFormat("%-*s", static_cast<int>(scales.size()), "mean IoU");
  for (int k = 0; k < answer.fixed_iou_size(); ++k) {
    absl::StrAppendFormat(&scales, "  %5g", answer.options().fixed_scales(k));
    absl::StrAppendFormat(&means, "  %5.3f", answer.fixed_iou(k));
  }
  rows.insert(rows.end(), {"", scales, means});
  return rows;
}

void AddEvaluate(CLI::App& app, Shell& shell) {
  auto flags = std::make_shared<EvaluateFlags>();
  CLI::App* verb =
      app.add_subcommand("evaluate", "Score a model by one click per entity, against label images");
  verb->add_option("SCENE", flags->scene, "Id of the scene")->required();
  verb->add_option(
          "LABELS_FOLDER", flags->folder,
          "Label images STEM.png, named as the photographs: grey, 8 or 16 bits, the entity's "
          "id in each pixel, 0 for none; only those of held-out views are read")
      ->required();
  verb->add_option("--ignore", flags->ignore,
                   "A grey PNG for all views: pixels that are not 0 are not scored");
  verb->add_option("--names", flags->names, "JSON file with the entities' names by id");
  verb->add_option("--threshold", flags->threshold, "Threshold (cosine) at the fixed scales")
      ->check(CLI::Range(-1.0, 1.0));
  verb->add_option("--model", flags->model, "Number of the model")->capture_default_str();
  AddFrameFlag(*verb, flags->frame);
  verb->callback(
      [flags, &shell] { shell.verb = [&, flags] { return RunEvaluate(shell, *flags); }; });
}

}  // namespace pepeseg::client::cli
