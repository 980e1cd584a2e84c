// The verb "demo": uploads a scene, trains it, clicks on four products, scores and names them.
#include <sys/utsname.h>
#include <unistd.h>

#include <algorithm>
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
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "clients/benchmark/demo_score.h"
#include "clients/benchmark/verbs.h"
#include "clients/cpp/dataset_folder.h"
#include "clients/cpp/file_bytes.h"
#include "clients/cpp/mask.h"
#include "clients/cpp/resource_names.h"
#include "clients/cpp/status_macros.h"
#include "clients/terminal/model_summary.h"
#include "clients/terminal/progress_line.h"
#include "clients/terminal/shell.h"
#include "clients/terminal/text_table.h"
#include "clients/terminal/training_run.h"
#include "clients/terminal/view_picture.h"
#include "pepeseg/v1/job_service.pb.h"
#include "pepeseg/v1/scene_service.pb.h"

namespace pepeseg::client::cli {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

// All that `pepeseg-benchmark demo` has measured.
struct DemoResult {
  v1::Job job;
  v1::Model model;
  // Wall time, seconds: "upload", each stage of the job, "train" (the whole job) and "queries"
  // (all queries).
  std::map<std::string, double> stage_seconds;
  DemoScores scores;

  // Returns the mean over the products of an IoU of one of their answers.
  double Mean(DemoAnswer ProductScore::*answer, double (DemoAnswer::*iou)() const) const {
    double sum = 0;
    for (const ProductScore& score : scores.products) sum += (score.*answer.*iou)();
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

// Returns an answer for report.json.
Json AnswerJson(const DemoAnswer& answer) {
  Json views = Json::array();
  for (const ViewScore& view : answer.views) {
    views.push_back({{"view", view.view}, {"clicked", view.clicked}, {"iou", view.iou}});
  }
  return {{"kind", answer.kind},
          {"scale", answer.scale},
          {"threshold", answer.threshold},
          {"iou_clicked_view", answer.ClickedIou()},
          {"iou_other_views", answer.OtherIou()},
          {"views", views}};
}

// Returns the entry of a product in report.json.
Json ProductJson(const ProductScore& score) {
  const auto& reference = score.scores.reference();
  return {{"product", score.product.id},
          {"name", score.product.name},
          {"clicked_view", score.scores.reference_view()},
          {"click", {score.click.x(), score.click.y()}},
          {"automatic", AnswerJson(score.automatic)},
          {"num_proposals", score.num_proposals},
          {"best_of_three", AnswerJson(score.chosen)},
          {"query_seconds", score.query_seconds},
          {"chosen_on_clicked_view",
           {{"scale", reference.scale_quantile()},
            {"threshold", reference.threshold()},
            {"iou_other_views", reference.mean().iou()},
            {"boundary_iou_other_views", reference.mean().boundary_iou()}}}};
}

// Returns the text of report.json.
std::string ReportJson(const DemoResult& result) {
  Json report;
  report["date"] = absl::FormatTime(absl::RFC3339_sec, absl::Now(), absl::UTCTimeZone());
  report["model"] = result.model.name();
  report["num_gaussians"] = result.model.num_gaussians();
  report["psnr"] = MetricOf(result.model, "psnr");
  report["ssim"] = MetricOf(result.model, "ssim");
  const auto answer = [&](DemoAnswer ProductScore::*which) {
    return Json{{"iou_clicked_view", result.Mean(which, &DemoAnswer::ClickedIou)},
                {"iou_other_views", result.Mean(which, &DemoAnswer::OtherIou)}};
  };
  report["mean_automatic"] = answer(&ProductScore::automatic);
  report["mean_best_of_three"] = answer(&ProductScore::chosen);
  const v1::EvaluateModelResponse& evaluation = result.scores.evaluation;
  report["mean_iou_chosen_on_clicked_view"] = evaluation.scene().reference().iou();
  report["mean_boundary_iou_chosen_on_clicked_view"] =
      evaluation.scene().reference().boundary_iou();
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
      "one click on each product; IoU in the clicked view, and in the other view:\n"
      "  %-28s  %-15s  %s\n",
      MetricOf(result.model, "psnr"), MetricOf(result.model, "ssim"), result.model.num_gaussians(),
      "", "first answer", "best of up to 3 proposals");
  for (const ProductScore& score : result.scores.products) {
    const DemoAnswer& first = score.automatic;
    const DemoAnswer& chosen = score.chosen;
    absl::StrAppendFormat(&text, "  %-28s  %.3f  %.3f     %.3f  %.3f  %s\n", score.product.name,
                          first.ClickedIou(), first.OtherIou(), chosen.ClickedIou(),
                          chosen.OtherIou(), chosen.kind);
  }
  absl::StrAppendFormat(&text, "  %-28s  %.3f  %.3f     %.3f  %.3f\nseconds:", "mean",
                        result.Mean(&ProductScore::automatic, &DemoAnswer::ClickedIou),
                        result.Mean(&ProductScore::automatic, &DemoAnswer::OtherIou),
                        result.Mean(&ProductScore::chosen, &DemoAnswer::ClickedIou),
                        result.Mean(&ProductScore::chosen, &DemoAnswer::OtherIou));
  for (const auto& [stage, seconds] : result.stage_seconds) {
    absl::StrAppendFormat(&text, "  %s %.1f", stage, seconds);
  }
  return text;
}

// One colour for each product.
constexpr std::array<Rgb, 4> kColors = {
    {{230, 60, 60}, {60, 200, 80}, {70, 130, 255}, {250, 200, 40}}};
constexpr Rgb kWhite{255, 255, 255};

// Returns the chosen answer in a view; null if the view does not show the product.
const ViewScore* Find(const ProductScore& score, const std::string& view) {
  for (const ViewScore& candidate : score.chosen.views) {
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
  const std::array<Panel, 3> panels = {
      {{found->clicked ? "photo, the click, label in white" : "photo, label in white", photo},
       {"rendering of a view not trained on", render},
       {absl::StrFormat("%s: IoU %.2f", score.product.name, found->iou), overlay}}};
  const std::string file = absl::StrCat(score.product.id, "-", Stem(view.name), ".png");
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
  std::string scene;         // id; "": the first of demo, demo-2, ... that does not exist
  bool photos_only = false;  // upload no poses, masks and depth
  std::vector<std::string> settings;
};

// Removes all files from the list but photographs and ignore masks.
void KeepPhotographs(DatasetFolder& folder) {
  std::erase_if(folder.files, [](const FolderFile& file) {
    return file.kind != v1::FILE_KIND_IMAGE && file.kind != v1::FILE_KIND_IGNORE_MASK;
  });
}

// Returns the scene of the flags, or one that does not exist yet.
absl::StatusOr<std::string> SceneOfDemo(const Client& client, const DemoFlags& flags) {
  if (!flags.scene.empty()) return SceneName(flags.scene);
  for (int number = 1;; ++number) {
    const std::string scene = SceneName(number == 1 ? "demo" : absl::StrCat("demo-", number));
    const absl::Status status = client.GetScene(scene).status();
    if (absl::IsNotFound(status)) return scene;
    RETURN_IF_ERROR(status);
  }
}

// Labels each product with the mask that was chosen in the clicked view. A label that the scene has
// already stays.
absl::Status NameProducts(const Client& client, const std::string& scene,
                          const DemoScores& scores) {
  for (const ProductScore& score : scores.products) {
    for (const ViewScore& view : score.chosen.views) {
      if (!view.clicked || std::find(view.mask.begin(), view.mask.end(), 1) == view.mask.end()) {
        continue;
      }
      v1::CreateLabelRequest request;
      request.set_parent(scene);
      request.set_label_id(score.product.id);
      v1::Label& label = *request.mutable_label();
      label.set_text(score.product.name);
      label.set_view(view.view);
      *label.mutable_mask()->mutable_rle() = EncodeRle(view.mask, view.width, view.height);
      const absl::Status status = client.CreateLabel(std::move(request)).status();
      if (!absl::IsAlreadyExists(status)) RETURN_IF_ERROR(status);
    }
  }
  return absl::OkStatus();
}

// Uploads the scene and sets `dataset` to the name of the sealed dataset.
absl::Status Upload(const Client& client, const DatasetFolder& folder, const std::string& scene,
                    DemoResult& result, std::string& dataset) {
  const Stopwatch watch;
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
  DemoResult result;
  const fs::path report_file = fs::path(flags.out) / "report.json";
  // Fail before the training, not after it, if the report cannot be written.
  RETURN_IF_ERROR(OutputFile::Create(report_file).status());
  ASSIGN_OR_RETURN(DatasetFolder folder, ReadDatasetFolder(flags.data));
  if (flags.photos_only) KeepPhotographs(folder);
  ASSIGN_OR_RETURN(const std::string scene, SceneOfDemo(client, flags));
  std::string dataset;
  RETURN_IF_ERROR(Upload(client, folder, scene, result, dataset));
  RETURN_IF_ERROR(Train(client, flags, scene, dataset, result));

  const Stopwatch watch;
  ASSIGN_OR_RETURN(const std::vector<v1::View> model_views, client.ListViews(result.model.name()));
  ASSIGN_OR_RETURN(const std::vector<DemoView> views, ReadHeldOut(flags.data, model_views));
  ASSIGN_OR_RETURN(result.scores,
                   ScoreProducts(client, result.model.name(), views, DemoProducts()));
  result.stage_seconds["queries"] = watch.Seconds();
  RETURN_IF_ERROR(NameProducts(client, scene, result.scores));
  const std::string report = ReportJson(result);
  RETURN_IF_ERROR(WriteFile(report_file, report));
  RETURN_IF_ERROR(WritePictures(flags.out, client, views, result));
  Print(shell.json ? report : ReportText(result));
  Note(absl::StrCat("report.json and the pictures are in ", flags.out,
                    "; the scene, with its products named, stays on the server"));
  const std::string open =
      absl::StrCat("To click in it yourself: make web, then open http://127.0.0.1:8080/", scene);
  shell.json ? Note(open) : Print(open);
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
  verb->add_option("--scene", flags->scene,
                   "Id of the scene; by default a new one: demo, demo-2, ...");
  verb->add_flag("--photos", flags->photos_only,
                 "Upload only the photographs: the server makes poses, masks and depth");
  verb->add_option("-o,--option", flags->settings, "Any option; overrides those of the demo")
      ->type_name("NAME=VALUE")
      ->allow_extra_args(false);
  verb->callback([flags, &shell] { shell.verb = [&, flags] { return RunDemo(shell, *flags); }; });
}

}  // namespace pepeseg::client::cli
