// The verb "datasets": lists the datasets of a scene, describes one, or deletes an unfinished
// upload.
#include <memory>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/time/clock.h"
#include "clients/cli/shell.h"
#include "clients/cli/text_table.h"
#include "clients/cpp/client.h"
#include "clients/cpp/resource_names.h"
#include "clients/cpp/status_macros.h"

namespace pepeseg::client::cli {
namespace {

struct DatasetsFlags {
  std::string scene;
  int number = 0;  // of a dataset; 0: list all
  int upload = 0;  // number of the upload to delete; 0: none
};

TableRow RowOf(const v1::Dataset& dataset, absl::Time now) {
  return {dataset.name().substr(dataset.name().rfind('/') + 1), AgeText(dataset.seal_time(), now),
          absl::StrCat(dataset.num_files()), SizeText(dataset.num_bytes()),
          absl::StrCat(dataset.advice_size())};
}

// Prints a table of the datasets of a scene.
absl::Status ListDatasets(const Shell& shell, const Client& client, const std::string& scene) {
  ASSIGN_OR_RETURN(const v1::ListDatasetsResponse all, client.ListDatasets(scene));
  if (shell.json) {
    PrintJson(all);
    return absl::OkStatus();
  }
  std::vector<TableRow> rows = {{"DATASET", "AGE", "FILES", "SIZE", "ADVICE"}};
  for (const v1::Dataset& dataset : all.datasets()) rows.push_back(RowOf(dataset, absl::Now()));
  for (const std::string& line : TextTable(rows)) Print(line);
  return absl::OkStatus();
}

// Prints a dataset with its advice.
absl::Status DescribeDataset(const Shell& shell, const Client& client, const std::string& name) {
  ASSIGN_OR_RETURN(const v1::Dataset dataset, client.GetDataset(name));
  if (shell.json) {
    PrintJson(dataset);
    return absl::OkStatus();
  }
  Print(absl::StrFormat("%s: %d files, %s", dataset.name(), dataset.num_files(),
                        SizeText(dataset.num_bytes())));
  for (const std::string& advice : dataset.advice()) Print("advice: " + advice);
  return absl::OkStatus();
}

absl::Status RunDatasets(const Shell& shell, const DatasetsFlags& flags) {
  const Client client(shell.channel);
  const std::string scene = SceneName(flags.scene);
  if (flags.upload > 0) return client.DeleteUpload(absl::StrCat(scene, "/uploads/", flags.upload));
  if (flags.number == 0) return ListDatasets(shell, client, scene);
  return DescribeDataset(shell, client, absl::StrCat(scene, "/datasets/", flags.number));
}

}  // namespace

void AddDatasets(CLI::App& app, Shell& shell) {
  auto flags = std::make_shared<DatasetsFlags>();
  CLI::App* verb = app.add_subcommand("datasets", "List a scene's datasets, or describe one");
  verb->add_option("SCENE", flags->scene, "Id of the scene")->required();
  CLI::Option* number =
      verb->add_option("NUMBER", flags->number, "Number of a dataset")->check(CLI::PositiveNumber);
  verb->add_option("--delete-upload", flags->upload,
                   "Delete the unfinished upload of this number, with what was sent of it")
      ->type_name("NUMBER")
      ->check(CLI::PositiveNumber)
      ->excludes(number);
  verb->callback(
      [flags, &shell] { shell.verb = [&, flags] { return RunDatasets(shell, *flags); }; });
}

}  // namespace pepeseg::client::cli
