// The verb "demo": uploads a scene, trains it, segments four products and scores them.
#include <filesystem>
#include <memory>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "clients/cli/demo_report.h"
#include "clients/cli/demo_score.h"
#include "clients/cli/enum_words.h"
#include "clients/cli/jobs.h"
#include "clients/cli/progress_line.h"
#include "clients/cli/shell.h"
#include "clients/cli/training.h"
#include "clients/cli/upload.h"
#include "clients/cpp/dataset_folder.h"
#include "clients/cpp/file_bytes.h"
#include "clients/cpp/resource_names.h"
#include "clients/cpp/status_macros.h"

namespace pepeseg::client::cli {
namespace {

namespace fs = std::filesystem;

// Returns options with which two cores train in about two and a half minutes. All others are the
// server's defaults.
const std::vector<std::string>& DemoSettings() {
  // Those of stage one are measured in tests/bench/results/scenes_cpu.md.
  static const std::vector<std::string> settings = {"reconstruct.num_steps=2000",
                                                    "reconstruct.coarse_until=0.5",
                                                    "reconstruct.sh_degree=1",
                                                    "reconstruct.max_gaussians=30000",
                                                    "reconstruct.ssim_weight=0.3",
                                                    "reconstruct.mean_learning_rate=1.6e-3",
                                                    "reconstruct.mean_learning_rate_final=1.6e-4",
                                                    "reconstruct.sh_learning_rate=5e-3",
                                                    "reconstruct.densify_gradient=3e-4",
                                                    "features.num_steps=1500"};
  return settings;
}

struct DemoFlags {
  std::string data;          // folder of the scene
  std::string out;           // folder for the report
  std::string scene;         // "": a new one
  bool photos_only = false;  // upload no poses, masks and depth
  std::vector<std::string> settings;
  FixedGranularity fixed{0.3, 0.75};
};

// Removes all files from the list but photographs and ignore masks.
void KeepPhotographs(DatasetFolder& folder) {
  std::erase_if(folder.files, [](const FolderFile& file) {
    return file.kind != v1::FILE_KIND_IMAGE && file.kind != v1::FILE_KIND_IGNORE_MASK;
  });
}

// Uploads the scene and sets `dataset` to the name of the sealed dataset.
absl::Status Upload(const Client& client, const DemoFlags& flags, const std::string& scene,
                    DemoResult& result, std::string& dataset) {
  const Stopwatch watch;
  ASSIGN_OR_RETURN(DatasetFolder folder, ReadDatasetFolder(flags.data));
  if (flags.photos_only) KeepPhotographs(folder);
  RETURN_IF_ERROR(client.EnsureScene(scene));
  ASSIGN_OR_RETURN(const v1::Dataset sealed, UploadFolder(client, scene, folder));
  dataset = sealed.name();
  result.stage_seconds["upload"] = watch.Seconds();
  return absl::OkStatus();
}

// Trains `dataset` and waits for the model.
absl::Status Train(const Client& client, const DemoFlags& flags, const std::string& scene,
                   const std::string& dataset, DemoResult& result) {
  const Stopwatch watch;
  std::vector<std::string> settings = DemoSettings();
  settings.insert(settings.end(), flags.settings.begin(), flags.settings.end());
  ASSIGN_OR_RETURN(const v1::Job job, StartTraining(client, scene, dataset, settings));
  ASSIGN_OR_RETURN(result.job, WatchJob(client, job.name(), [&](const v1::JobEvent& event) {
                     if (event.event_case() != v1::JobEvent::kStageEnded) return;
                     const auto& ended = event.stage_ended();
                     result.stage_seconds[WordOf(ended.stage())] = SecondsOf(ended.elapsed());
                   }));
  ASSIGN_OR_RETURN(result.model, client.GetModel(result.job.model()));
  result.stage_seconds["train"] = watch.Seconds();
  return absl::OkStatus();
}

absl::Status RunDemo(const Shell& shell, const DemoFlags& flags) {
  const Client client(shell.channel);
  const std::string scene = SceneName(
      flags.scene.empty() ? absl::StrCat("demo-", absl::ToUnixMillis(absl::Now())) : flags.scene);
  DemoResult result;
  result.fixed = flags.fixed;
  const fs::path report_file = fs::path(flags.out) / "report.json";
  // Fail before the training, not after it, if the report cannot be written.
  RETURN_IF_ERROR(OutputFile::Create(report_file).status());
  std::string dataset;
  RETURN_IF_ERROR(Upload(client, flags, scene, result, dataset));
  RETURN_IF_ERROR(Train(client, flags, scene, dataset, result));

  const Stopwatch watch;
  ASSIGN_OR_RETURN(const std::vector<v1::View> model_views, client.ListViews(result.model.name()));
  ASSIGN_OR_RETURN(const std::vector<DemoView> views, ReadHeldOut(flags.data, model_views));
  ASSIGN_OR_RETURN(result.scores,
                   ScoreProducts(client, result.model.name(), views, DemoProducts(), flags.fixed));
  result.stage_seconds["questions"] = watch.Seconds();
  const std::string report = ReportJson(result);
  RETURN_IF_ERROR(WriteFile(report_file, report));
  RETURN_IF_ERROR(WritePictures(flags.out, client, views, result));
  Print(shell.json ? report : ReportText(result));
  Note(absl::StrCat("report.json and the pictures are in ", flags.out));
  return absl::OkStatus();
}

}  // namespace

void AddDemo(CLI::App& app, Shell& shell) {
  auto flags = std::make_shared<DemoFlags>();
  CLI::App* verb =
      app.add_subcommand("demo", "Train, segment and score the scene that ships with pepeseg");
  verb->add_option("--data", flags->data, "Folder of the scene")
      ->default_val("tests/data/apc_shelf");
  verb->add_option("--out", flags->out, "Folder for report.json and the pictures")
      ->default_val("build/demo");
  verb->add_option("--scene", flags->scene, "Id of the scene; by default a new one");
  verb->add_flag("--photos", flags->photos_only,
                 "Upload only the photographs: the server makes poses, masks and depth");
  verb->add_option("-o,--option", flags->settings, "Any option; overrides those of the demo")
      ->type_name("NAME=VALUE")
      ->allow_extra_args(false);
  verb->add_option("--scale", flags->fixed.scale, "Scale of the segments, a quantile")
      ->check(CLI::Range(0.0, 1.0))
      ->capture_default_str();
  verb->add_option("--threshold", flags->fixed.threshold, "Threshold of the segments, a cosine")
      ->check(CLI::Range(-1.0, 1.0))
      ->capture_default_str();
  verb->callback([flags, &shell] { shell.verb = [&, flags] { return RunDemo(shell, *flags); }; });
}

}  // namespace pepeseg::client::cli
