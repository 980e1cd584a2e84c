// The verb "demo": uploads a scene, trains it, segments four products and scores them.
#include <sys/utsname.h>
#include <unistd.h>

#include <array>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_replace.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "clients/cli/datasets.h"
#include "clients/cli/demo_score.h"
#include "clients/cli/jobs.h"
#include "clients/cli/model_summary.h"
#include "clients/cli/progress_line.h"
#include "clients/cli/shell.h"
#include "clients/cli/text_table.h"
#include "clients/cli/training.h"
#include "clients/cli/view_picture.h"
#include "clients/cpp/dataset_folder.h"
#include "clients/cpp/file_bytes.h"
#include "clients/cpp/resource_names.h"
#include "clients/cpp/status_macros.h"
#include "pepeseg/v1/job_service.pb.h"
#include "pepeseg/v1/scene_service.pb.h"

namespace pepeseg::client::cli {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

// All that `pepeseg demo` has measured.
struct DemoResult {
  v1::Job job;
  v1::Model model;
  // Wall time, seconds: "upload", each stage of the job, "train" (the whole job) and "questions"
  // (all queries).
  std::map<std::string, double> stage_seconds;
  FixedGranularity fixed;
  DemoScores scores;

  // Returns the mean over the products of their mean IoU at the fixed granularity, clicked view
  // included.
  double MeanIou() const {
    double sum = 0;
    for (const ProductScore& score : scores.products) sum += score.mean_iou;
    return scores.products.empty() ? 0 : sum / static_cast<double>(scores.products.size());
  }
};

// Returns the name of the processor from /proc/cpuinfo, or "unknown".
std::string CpuModel() {
  std::ifstream file("/proc/cpuinfo");
  for (std::string line; std::getline(file, line);) {
    const size_t colon = line.find(": ");
    if (absl::StartsWith(line, "model name") && colon != std::string::npos) {
      return line.substr(colon + 2);
    }
  }
  return "unknown";
}

// Describes the machine of the client, on which the demo runs the server, too.
Json Machine() {
  utsname system{};
  uname(&system);
  const double pages = static_cast<double>(sysconf(_SC_PHYS_PAGES));
  return {{"cpu", CpuModel()},
          {"cores", std::thread::hardware_concurrency()},
          {"memory_gib", pages * static_cast<double>(sysconf(_SC_PAGESIZE)) / (1 << 30)},
          {"system", absl::StrCat(system.sysname, " ", system.release, " ", system.machine)}};
}

// Returns the entry of a product in report.json.
Json ProductJson(const ProductScore& score) {
  Json views = Json::array();
  for (const ViewScore& view : score.views) {
    views.push_back({{"view", view.view}, {"clicked", view.clicked}, {"iou", view.iou}});
  }
  const auto& chosen = score.scores.reference();
  const auto& oracle = score.scores.paper();
  return {{"product", score.product.name},
          {"click", {score.click.x(), score.click.y()}},
          {"mean_iou", score.mean_iou},
          {"views", views},
          {"query_seconds", score.query_seconds},
          {"chosen_on_clicked_view",
           {{"scale", chosen.scale_quantile()},
            {"threshold", chosen.threshold()},
            {"iou_other_views", chosen.mean().iou()},
            {"boundary_iou_other_views", chosen.mean().boundary_iou()}}},
          {"oracle_iou_other_views", oracle.mean().iou()}};
}

// Returns the text of report.json.
std::string ReportJson(const DemoResult& result) {
  Json report;
  report["date"] = absl::FormatTime(absl::RFC3339_sec, absl::Now(), absl::UTCTimeZone());
  report["model"] = result.model.name();
  report["num_gaussians"] = result.model.num_gaussians();
  report["psnr"] = MetricOf(result.model, "psnr");
  report["ssim"] = MetricOf(result.model, "ssim");
  report["mean_iou"] = result.MeanIou();
  const v1::EvaluateModelResponse& evaluation = result.scores.evaluation;
  report["mean_iou_chosen_on_clicked_view"] = evaluation.scene().reference().iou();
  report["mean_boundary_iou_chosen_on_clicked_view"] =
      evaluation.scene().reference().boundary_iou();
  report["mean_iou_oracle"] = evaluation.scene().paper().iou();
  report["question"] = {{"scale", result.fixed.scale}, {"threshold", result.fixed.threshold}};
  report["products"] = Json::array();
  for (const ProductScore& score : result.scores.products) {
    report["products"].push_back(ProductJson(score));
  }
  report["seconds"] = result.stage_seconds;
  report["metrics"] = Json::parse(ToJson(result.model)).value("metrics", Json::object());
  report["settings"] = Json::parse(ToJson(result.job.effective_options()));
  report["machine"] = Machine();
  return report.dump(2) + "\n";
}

// Returns the report for a person.
std::string ReportText(const DemoResult& result) {
  std::string text = absl::StrFormat(
      "\nheld-out views: PSNR %.2f dB, SSIM %.3f, %d Gaussians\n"
      "one click per product, scale %.2f, threshold %.2f:\n",
      MetricOf(result.model, "psnr"), MetricOf(result.model, "ssim"), result.model.num_gaussians(),
      result.fixed.scale, result.fixed.threshold);
  for (const ProductScore& score : result.scores.products) {
    absl::StrAppendFormat(&text, "  %-28s IoU %.3f  (", score.product.name, score.mean_iou);
    for (const ViewScore& view : score.views) {
      absl::StrAppendFormat(&text, "%s%s %.3f%s", &view == score.views.data() ? "" : ", ",
                            view.view, view.iou, view.clicked ? " clicked" : "");
    }
    absl::StrAppendFormat(&text, ")  chosen %.2f/%.2f: %.3f on the others\n",
                          score.scores.reference().scale_quantile(),
                          score.scores.reference().threshold(),
                          score.scores.reference().mean().iou());
  }
  absl::StrAppendFormat(&text,
                        "  %-28s IoU %.3f  (scale and threshold chosen: %.3f)\nseconds:", "mean",
                        result.MeanIou(), result.scores.evaluation.scene().reference().iou());
  for (const auto& [stage, seconds] : result.stage_seconds) {
    absl::StrAppendFormat(&text, "  %s %.1f", stage, seconds);
  }
  return text;
}

// One colour for each product.
constexpr std::array<Rgb, 4> kColors = {
    {{230, 60, 60}, {60, 200, 80}, {70, 130, 255}, {250, 200, 40}}};
constexpr Rgb kWhite{255, 255, 255};

// Returns the score of a view; null if the view does not show the product.
const ViewScore* Find(const ProductScore& score, const std::string& view) {
  for (const ViewScore& candidate : score.views) {
    if (candidate.view == view) return &candidate;
  }
  return nullptr;
}

// Writes PRODUCT-STEM.png.
absl::Status WriteProduct(const fs::path& folder, const DemoView& view, const Picture& render,
                          const ProductScore& score, Rgb color) {
  const ViewScore* found = Find(score, view.name);
  if (found == nullptr) return absl::OkStatus();
  Picture photo = view.photo;
  DrawOutline(photo, view.TruthOf(score.product.label), kWhite);
  if (found->clicked) DrawClick(photo, score.click.x(), score.click.y(), color);
  Picture overlay = view.photo;
  DrawMask(overlay, found->mask, color);
  const std::string name = absl::StrReplaceAll(score.product.name, {{"_", " "}});
  const std::array<Panel, 3> panels = {
      {{found->clicked ? "photo, the click, label in white" : "photo, label in white", photo},
       {"rendering of a view not trained on", render},
       {absl::StrFormat("%s: IoU %.2f", name, found->iou), overlay}}};
  const std::string file = absl::StrCat(score.product.name, "-", Stem(view.name), ".png");
  return WritePng(folder / file, SideBySide(panels));
}

// Writes overview-STEM.png.
absl::Status WriteOverview(const fs::path& folder, const DemoView& view, const Picture& render,
                           const DemoResult& result) {
  Picture overlay = view.photo;
  const std::vector<ProductScore>& products = result.scores.products;
  for (size_t i = 0; i < products.size(); ++i) {
    const ViewScore* found = Find(products[i], view.name);
    if (found == nullptr) continue;
    DrawMask(overlay, found->mask, kColors[i % kColors.size()]);
    if (found->clicked) {
      DrawClick(overlay, products[i].click.x(), products[i].click.y(), kWhite);
    }
  }
  const std::array<Panel, 3> panels = {{{"photo", view.photo},
                                        {"rendering of a view not trained on", render},
                                        {"masks of one click each", overlay}}};
  return WritePng(folder / absl::StrCat("overview-", Stem(view.name), ".png"), SideBySide(panels));
}

// Writes to `folder`, for each view, overview-STEM.png with all products, and PRODUCT-STEM.png for
// each product that it shows: photograph with label and click, rendering, mask over the photograph.
absl::Status WritePictures(const fs::path& folder, const Client& client,
                           const std::vector<DemoView>& views, const DemoResult& result) {
  for (const DemoView& view : views) {
    ASSIGN_OR_RETURN(const Picture rendered, RenderView(client, result.model.name(), view.name));
    const Picture render = Resized(rendered, view.photo.width, view.photo.height);
    RETURN_IF_ERROR(WriteOverview(folder, view, render, result));
    const std::vector<ProductScore>& products = result.scores.products;
    for (size_t i = 0; i < products.size(); ++i) {
      RETURN_IF_ERROR(WriteProduct(folder, view, render, products[i], kColors[i % kColors.size()]));
    }
  }
  return absl::OkStatus();
}

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
