#include "clients/cli/demo_report.h"

#include <sys/utsname.h>
#include <unistd.h>

#include <array>
#include <fstream>
#include <nlohmann/json.hpp>
#include <thread>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_replace.h"
#include "absl/time/clock.h"
#include "clients/cli/shell.h"
#include "clients/cli/view_picture.h"
#include "clients/cpp/status_macros.h"

namespace pepeseg::client::cli {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

// One colour for each product.
constexpr std::array<Rgb, 4> kColors = {
    {{230, 60, 60}, {60, 200, 80}, {70, 130, 255}, {250, 200, 40}}};
constexpr Rgb kWhite{255, 255, 255};

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

// Returns a metric of the model; 0 if it was not measured.
double Metric(const v1::Model& model, const std::string& name) {
  const auto found = model.metrics().find(name);
  return found == model.metrics().end() ? 0 : found->second;
}

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

}  // namespace

double DemoResult::MeanIou() const {
  double sum = 0;
  for (const ProductScore& score : scores.products) sum += score.mean_iou;
  return scores.products.empty() ? 0 : sum / static_cast<double>(scores.products.size());
}

std::string ReportJson(const DemoResult& result) {
  Json report;
  report["date"] = absl::FormatTime(absl::RFC3339_sec, absl::Now(), absl::UTCTimeZone());
  report["model"] = result.model.name();
  report["num_gaussians"] = result.model.num_gaussians();
  report["psnr"] = Metric(result.model, "psnr");
  report["ssim"] = Metric(result.model, "ssim");
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

std::string ReportText(const DemoResult& result) {
  std::string text = absl::StrFormat(
      "\nheld-out views: PSNR %.2f dB, SSIM %.3f, %d Gaussians\n"
      "one click per product, scale %.2f, threshold %.2f:\n",
      Metric(result.model, "psnr"), Metric(result.model, "ssim"), result.model.num_gaussians(),
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

}  // namespace pepeseg::client::cli
