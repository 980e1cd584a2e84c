#include "clients/cli/demo_report.h"

#include <sys/utsname.h>
#include <unistd.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <thread>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/string_view.h"
#include "absl/time/clock.h"
#include "clients/cli/shell.h"

namespace pepeseg::client::cli {
namespace {

using Json = nlohmann::ordered_json;

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

// Of the client; the demo runs both on one machine.
Json Machine() {
  utsname system{};
  uname(&system);
  const double pages = static_cast<double>(sysconf(_SC_PHYS_PAGES));
  return {{"cpu", CpuModel()},
          {"cores", std::thread::hardware_concurrency()},
          {"memory_gib", pages * static_cast<double>(sysconf(_SC_PAGESIZE)) / (1 << 30)},
          {"system", absl::StrCat(system.sysname, " ", system.release, " ", system.machine)}};
}

Json ProductJson(const ProductScore& score) {
  Json views = Json::array();
  for (const ViewScore& view : score.views) {
    views.push_back({{"view", view.view}, {"clicked", view.clicked}, {"iou", view.iou}});
  }
  const auto& chosen = score.scores.chosen();
  const auto& oracle = score.scores.oracle();
  return {{"product", score.product.name},
          {"click", {score.scores.click_x(), score.scores.click_y()}},
          {"mean_iou", score.mean_iou},
          {"views", views},
          {"query_seconds", score.query_seconds},
          {"chosen_on_clicked_view",
           {{"scale", chosen.scale_quantile()},
            {"threshold", chosen.threshold()},
            {"iou_other_views", chosen.iou()},
            {"boundary_iou_other_views", chosen.boundary_iou()}}},
          {"oracle_iou_other_views", oracle.iou()}};
}

double Metric(const v1::Model& model, const std::string& name) {
  const auto found = model.metrics().find(name);
  return found == model.metrics().end() ? 0 : found->second;
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
  const v1::EvaluateResponse& evaluation = result.scores.evaluation;
  report["mean_iou_chosen_on_clicked_view"] = evaluation.chosen().iou();
  report["mean_boundary_iou_chosen_on_clicked_view"] = evaluation.chosen().boundary_iou();
  report["mean_iou_oracle"] = evaluation.oracle().iou();
  report["question"] = {{"scale", result.question.scale}, {"threshold", result.question.threshold}};
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
      result.question.scale, result.question.threshold);
  for (const ProductScore& score : result.scores.products) {
    absl::StrAppendFormat(&text, "  %-28s IoU %.3f  (", score.product.name, score.mean_iou);
    for (const ViewScore& view : score.views) {
      absl::StrAppendFormat(&text, "%s%s %.3f%s", &view == score.views.data() ? "" : ", ",
                            view.view, view.iou, view.clicked ? " clicked" : "");
    }
    absl::StrAppendFormat(&text, ")  chosen %.2f/%.2f: %.3f on the others\n",
                          score.scores.chosen().scale_quantile(), score.scores.chosen().threshold(),
                          score.scores.chosen().iou());
  }
  absl::StrAppendFormat(&text,
                        "  %-28s IoU %.3f  (scale and threshold chosen: %.3f)\nseconds:", "mean",
                        result.MeanIou(), result.scores.evaluation.chosen().iou());
  for (const auto& [stage, seconds] : result.stage_seconds) {
    absl::StrAppendFormat(&text, "  %s %.1f", stage, seconds);
  }
  return text;
}

}  // namespace pepeseg::client::cli
