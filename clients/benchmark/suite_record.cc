#include "clients/benchmark/suite_record.h"

#include <algorithm>
#include <tuple>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "clients/cpp/file_bytes.h"
#include "clients/cpp/status_macros.h"

namespace pepeseg::client::cli {
namespace {

RunScores ToRunScores(bool known, const v1::EvaluateModelResponse::Scores& scores) {
  return {known, scores.iou(), scores.accuracy(), scores.boundary_iou()};
}

auto KeyOf(const ScoredRun& run) {
  return std::tie(run.benchmark, run.scene, run.variant, run.protocol, run.seed, run.options);
}

}  // namespace

LevelScores ScoresOf(const std::string& level, const v1::EvaluateModelResponse& response) {
  const auto& scene = response.scene();
  LevelScores scores;
  scores.name = level;
  scores.num_entities = response.entities_size();
  scores.left_out.assign(response.left_out().begin(), response.left_out().end());
  scores.paper = ToRunScores(scene.has_paper(), scene.paper());
  scores.reference = ToRunScores(scene.has_reference(), scene.reference());
  scores.automatic = ToRunScores(scene.has_automatic(), scene.automatic());
  for (const auto& entity : response.entities()) {
    const auto iou = [](bool known, const v1::EvaluateModelResponse::Choice& choice) {
      return known ? choice.mean().iou() : -1;
    };
    scores.entities.push_back({entity.name(), iou(entity.has_paper(), entity.paper()),
                               iou(entity.has_reference(), entity.reference()),
                               iou(entity.has_automatic(), entity.automatic())});
  }
  const auto& scales = response.options().scales();
  scores.scales.assign(scales.begin(), scales.end());
  scores.iou_by_scale.assign(scene.iou_by_scale().begin(), scene.iou_by_scale().end());
  return scores;
}

void SetClicks(const v1::EvaluateModelResponse& response, LevelScores& level) {
  level.num_clicks = response.scene().num_clicks();
  level.reached = response.scene().reached();
}

void AddSamAgreement(const v1::EvaluateModelResponse::SamAgreement& agreement, ScoredRun& run) {
  const auto before = static_cast<double>(run.sam_masks);
  const auto added = static_cast<double>(agreement.num_masks());
  if (before + added == 0) return;
  const auto mean = [&](double old_mean, double new_mean) {
    return (before * old_mean + added * new_mean) / (before + added);
  };
  run.sam_first_iou = mean(run.sam_first_iou, agreement.first_iou());
  run.sam_best_iou = mean(run.sam_best_iou, agreement.best_iou());
  run.sam_masks += agreement.num_masks();
}

void SetModelFacts(const v1::Model& model, const std::vector<v1::View>& views, ScoredRun& run) {
  run.device = model.device();
  for (const auto& [name, value] : model.metrics()) {
    if (name == "psnr") run.psnr = value;
    if (name == "ssim") run.ssim = value;
    if (name == "peak_memory_bytes") run.host_bytes = value;
    if (name == "peak_device_bytes") run.device_bytes = value;
    if (absl::StartsWith(name, "seconds_")) run.seconds[name.substr(8)] = value;
  }
  double sum = 0;
  int count = 0;
  for (const v1::View& view : views) {
    if (!view.held_out() || !view.scores().has_lpips()) continue;
    sum += view.scores().lpips();
    ++count;
  }
  run.lpips = count == 0 ? 0 : sum / count;
}

absl::StatusOr<RunRecord> RunRecord::Open(const std::filesystem::path& file) {
  RunRecord record;
  record.file_ = file;
  std::error_code error;
  if (!std::filesystem::exists(file, error)) return record;
  ASSIGN_OR_RETURN(const std::string text, ReadFile(file));
  const std::vector<std::string> lines = absl::StrSplit(text, '\n');
  for (size_t i = 0; i < lines.size(); ++i) {
    if (lines[i].empty()) continue;
    const nlohmann::json json =
        nlohmann::json::parse(lines[i], nullptr, /*allow_exceptions=*/false);
    // Each line ends with a line feed, so the last part is empty unless it was cut off.
    if (i + 1 == lines.size()) break;
    if (!json.is_object() || !json.contains("scene")) {
      return absl::InvalidArgumentError(
          absl::StrCat(file.string(), ": line ", i + 1, " is not a run of a benchmark"));
    }
    try {
      record.runs_.push_back(json.get<ScoredRun>());
    } catch (const nlohmann::json::exception& wrong) {  // a field of another type
      return absl::InvalidArgumentError(
          absl::StrCat(file.string(), ": line ", i + 1, ": ", wrong.what()));
    }
  }
  return record;
}

bool RunRecord::Has(const ScoredRun& run) const {
  return std::any_of(runs_.begin(), runs_.end(),
                     [&](const ScoredRun& other) { return KeyOf(other) == KeyOf(run); });
}

absl::Status RunRecord::Add(ScoredRun run) {
  runs_.push_back(std::move(run));
  std::string text;
  for (const ScoredRun& each : runs_) absl::StrAppend(&text, nlohmann::json(each).dump(), "\n");
  return WriteFile(file_, text);
}

}  // namespace pepeseg::client::cli
