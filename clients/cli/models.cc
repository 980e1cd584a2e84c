// The verb "models": lists the models of a scene, describes or deletes one.
#include <memory>

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

struct ModelsFlags {
  std::string scene;
  int number = 0;       // of a model; 0: list all
  bool remove = false;  // delete the model
};

// Returns "3" for "scenes/shelf/models/3".
std::string NumberOf(const std::string& name) { return name.substr(name.rfind('/') + 1); }

TableRow RowOf(const v1::Model& model, absl::Time now) {
  const auto psnr = model.metrics().find("psnr");
  return {NumberOf(model.name()),
          AgeText(model.create_time(), now),
          SizeText(model.num_bytes()),
          absl::StrCat(model.num_gaussians()),
          psnr == model.metrics().end() ? "-" : absl::StrFormat("%.2f dB", psnr->second),
          model.job(),
          model.dataset().empty() ? "-" : NumberOf(model.dataset()),
          SourcesText(model)};
}

// Prints a table of the models of a scene.
absl::Status ListModels(const Shell& shell, const Client& client, const std::string& scene) {
  ASSIGN_OR_RETURN(const v1::ListModelsResponse all, client.ListModels(scene));
  if (shell.json) {
    PrintJson(all);
    return absl::OkStatus();
  }
  std::vector<TableRow> rows = {
      {"MODEL", "AGE", "SIZE", "GAUSSIANS", "PSNR", "JOB", "DATASET", "TRAINED ON"}};
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
  if (const std::string sources = SourcesText(model); !sources.empty()) {
    Print("  trained on: " + sources);
  }
  for (const auto& [metric, value] : model.metrics()) {
    Print(absl::StrFormat("  %s %.4g", metric, value));
  }
  if (const std::string quality = MaskQualityText(model); !quality.empty()) Print("  " + quality);
  PrintAdvice(model);
  return absl::OkStatus();
}

absl::Status RunModels(const Shell& shell, const ModelsFlags& flags) {
  const Client client(shell.channel);
  if (flags.number == 0) return ListModels(shell, client, SceneName(flags.scene));
  const std::string name = ModelName(flags.scene, std::to_string(flags.number));
  return flags.remove ? client.DeleteModel(name) : DescribeModel(shell, client, name);
}

}  // namespace

void AddModels(CLI::App& app, Shell& shell) {
  auto flags = std::make_shared<ModelsFlags>();
  CLI::App* verb =
      app.add_subcommand("models", "List a scene's models, newest first; describe or delete one");
  verb->add_option("SCENE", flags->scene, "Id of the scene")->required();
  CLI::Option* number =
      verb->add_option("NUMBER", flags->number, "Number of a model")->check(CLI::PositiveNumber);
  verb->add_flag("--delete", flags->remove,
                 "Delete the model with its selections; the model before it becomes the live one")
      ->needs(number);
  verb->callback([flags, &shell] { shell.verb = [&, flags] { return RunModels(shell, *flags); }; });
}

}  // namespace pepeseg::client::cli
