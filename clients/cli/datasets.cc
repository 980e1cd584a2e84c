// The verbs "upload", and "datasets", which lists the datasets of a scene, describes one, or
// deletes an unfinished upload.
#include <algorithm>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/string_view.h"
#include "absl/time/clock.h"
#include "clients/cli/verbs.h"
#include "clients/cpp/client.h"
#include "clients/cpp/resource_names.h"
#include "clients/cpp/status_macros.h"
#include "clients/terminal/model_summary.h"
#include "clients/terminal/shell.h"
#include "clients/terminal/text_table.h"
#include "clients/terminal/training_run.h"

namespace pepeseg::client::cli {
namespace {

constexpr size_t kMaxNames = 10;  // of files left out that are printed

// Returns what a file's folder holds instead, "; depth maps are ...", or "" for another folder.
std::string WhatIsTaken(absl::string_view name) {
  constexpr std::pair<const char*, const char*> kFolders[] = {
      {"images/", "photographs are .jpg, .jpeg, .png, .webp, .heic or .heif"},
      {"masks/", "masks are .json, .png or .npy"},
      {"ignore/", "ignore masks are .png"},
      {"depth/", "depth maps are .png, .npy or .pfm"},
      {"disparity/", "disparity maps are .png, .npy or .pfm"},
      {"sparse/", "COLMAP's files are cameras, images and points3D, .bin or .txt, and not empty"}};
  const bool in_layout = absl::StartsWith(name, "images/") || absl::StartsWith(name, "videos/");
  if (in_layout && KindOf(name) == v1::FILE_KIND_VIDEO) {
    return "; it has the name of a photograph, so it is that of a Live Photo";
  }
  for (const auto& [folder, taken] : kFolders) {
    if (absl::StartsWith(name, folder)) return absl::StrCat("; ", taken);
  }
  return "";
}

// Prints the first few files that are not part of the dataset, and how many more there are.
void NoteLeftOut(const std::vector<std::string>& names) {
  for (size_t i = 0; i < std::min(names.size(), kMaxNames); ++i) {
    Note(absl::StrCat("left out, not part of a dataset: ", names[i], WhatIsTaken(names[i])));
  }
  if (names.size() > kMaxNames) {
    Note(absl::StrCat("... and ", names.size() - kMaxNames, " more"));
  }
}

// Prints the size of a dataset, and its advice.
void PrintDataset(const v1::Dataset& dataset) {
  Print(absl::StrFormat("%s: %d files, %s", dataset.name(), dataset.num_files(),
                        SizeText(dataset.num_bytes())));
  for (const std::string& advice : dataset.advice()) Print("advice: " + advice);
}

struct UploadFlags {
  std::string scene;
  std::string folder;
  std::string depth_kind = "depth";
  bool dry_run = false;  // list the files, upload nothing
};

absl::Status RunUpload(const Shell& shell, const UploadFlags& flags) {
  ASSIGN_OR_RETURN(const DatasetFolder folder,
                   ReadDatasetFolder(flags.folder, DepthKind(flags.depth_kind)));
  NoteLeftOut(folder.left_out);
  if (!Has(folder, v1::FILE_KIND_POSES)) {
    Note("the dataset has no poses: the training will estimate them (stage sfm)");
  }
  if (flags.dry_run) {
    for (const FolderFile& file : folder.files) {
      Print(absl::StrFormat(
          "%-22s %s", v1::FileKind_Name(file.kind).substr(sizeof("FILE_KIND_") - 1), file.name));
    }
    return absl::OkStatus();
  }
  const Client client(shell.channel);
  const std::string scene = SceneName(flags.scene);
  RETURN_IF_ERROR(client.EnsureScene(scene));
  ASSIGN_OR_RETURN(const v1::Dataset dataset, UploadFolder(client, scene, folder));
  if (shell.json) {
    PrintJson(dataset);
  } else {
    PrintDataset(dataset);
    Print(absl::StrCat("Next: ", CommandText(shell, {"train", flags.scene})));
  }
  return absl::OkStatus();
}

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

absl::Status DescribeDataset(const Shell& shell, const Client& client, const std::string& name) {
  ASSIGN_OR_RETURN(const v1::Dataset dataset, client.GetDataset(name));
  shell.json ? PrintJson(dataset) : PrintDataset(dataset);
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

void AddUpload(CLI::App& app, Shell& shell) {
  auto flags = std::make_shared<UploadFlags>();
  CLI::App* verb = app.add_subcommand(
      "upload", "Upload photographs or a video, with poses, masks and depth if there are any");
  verb->add_option("SCENE", flags->scene, "Id of the scene; created if it is new")->required();
  verb->add_option(
          "FOLDER", flags->folder,
          "A folder of photographs, a video, or a folder with images/ or videos/ and any of "
          "sparse/0/ (COLMAP), masks/, ignore_mask.png, ignore/, depth/, disparity/, points.ply, "
          "gaussians.ply (used instead of stage one)")
      ->required();
  AddDepthKindFlag(*verb, flags->depth_kind);
  verb->add_flag("--dry-run", flags->dry_run,
                 "List the files with their kinds, and upload nothing");
  verb->callback([flags, &shell] { shell.verb = [&, flags] { return RunUpload(shell, *flags); }; });
}

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
