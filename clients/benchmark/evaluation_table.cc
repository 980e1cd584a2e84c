#include "clients/benchmark/evaluation_table.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_replace.h"
#include "clients/terminal/shell.h"
#include "clients/terminal/text_table.h"

namespace pepeseg::client::cli {
namespace {

using Evaluated = v1::EvaluateModelResponse;

constexpr size_t kNameColumns = 40;  // longest name of an entity in the table
constexpr int kEarlyClicks = 3;

std::string Number(double value) { return absl::StrFormat("%.3f", value); }

void AddScores(const Evaluated::Scores* scores, TableRow& row) {
  for (int i = 0; scores == nullptr && i < 3; ++i) row.push_back("-");
  if (scores == nullptr) return;
  row.push_back(Number(scores->iou()));
  row.push_back(Number(scores->accuracy()));
  row.push_back(Number(scores->boundary_iou()));
}

// Returns the cells of scale and threshold.
void AddGranularity(bool chosen, const Evaluated::Choice& choice, TableRow& row) {
  row.push_back(chosen ? absl::StrFormat("%.2f", choice.scale_quantile()) : "-");
  row.push_back(chosen ? absl::StrFormat("%.2f", choice.threshold()) : "-");
}

TableRow EntityRow(const Evaluated::Entity& entity) {
  TableRow row = {entity.name().substr(0, kNameColumns), absl::StrCat(entity.views_size())};
  AddScores(entity.has_reference() ? &entity.reference().mean() : nullptr, row);
  AddGranularity(entity.has_reference() && !entity.missing(), entity.reference(), row);
  AddScores(&entity.automatic().mean(), row);
  AddScores(&entity.paper().mean(), row);
  if (entity.missing()) row.push_back("nothing under the prompt");
  return row;
}

TableRow GroupRow(const std::string& name, const Evaluated::GroupScores& group) {
  TableRow row = {name, ""};
  AddScores(group.has_reference() ? &group.reference() : nullptr, row);
  row.emplace_back();  // scale and threshold are those of an entity
  row.emplace_back();
  AddScores(&group.automatic(), row);
  AddScores(&group.paper(), row);
  return row;
}

TableRow ClicksRow(const Evaluated::Entity& entity) {
  TableRow row = {entity.name().substr(0, kNameColumns), absl::StrCat(entity.views_size()),
                  absl::StrCat(entity.num_clicks()), entity.reached() ? "yes" : "no"};
  for (int k = 0; k < kEarlyClicks && entity.clicks_size() > 0; ++k) {
    row.push_back(Number(entity.clicks(std::min(k, entity.clicks_size() - 1)).iou()));
  }
  return row;
}

TableRow ClicksGroupRow(const std::string& name, const Evaluated::GroupScores& group) {
  TableRow row = {name, "", absl::StrFormat("%.2f", group.num_clicks()),
                  absl::StrFormat("%.0f%%", 100 * group.reached())};
  for (const double iou : group.iou_after()) row.push_back(Number(iou));
  return row;
}

std::vector<std::string> SamTable(const Evaluated& response) {
  const Evaluated::SamAgreement& sam = response.sam_agreement();
  std::vector<TableRow> rows = {{"view", "masks", "first IoU", "best* IoU"}};
  for (const Evaluated::SamView& view : sam.views()) {
    rows.push_back({view.view(), absl::StrCat(view.num_masks()), Number(view.first_iou()),
                    Number(view.best_iou())});
  }
  rows.push_back({"all masks", absl::StrCat(sam.num_masks()), Number(sam.first_iou()),
                  Number(sam.best_iou())});
  std::vector<std::string> lines = TextTable(rows);
  lines.push_back(absl::StrCat("* the best of ", response.options().sam_agreement().num_proposals(),
                               " proposals, chosen by the mask that it is scored with"));
  return lines;
}

bool CountsClicks(const Evaluated& response) {
  return response.options().protocol() == v1::EVALUATION_PROTOCOL_CLICKS;
}

std::vector<TableRow> EntityRows(const Evaluated& response) {
  const bool clicks = CountsClicks(response);
  std::vector<TableRow> rows;
  if (clicks) {
    rows.push_back({"entity", "views", "clicks", "reached", "IoU after 1", "after 2", "after 3"});
  } else {
    rows.push_back({"entity", "views", "reference IoU", "Acc", "BIoU", "scale", "threshold",
                    "automatic IoU", "Acc", "BIoU", "paper* IoU", "Acc*", "BIoU*"});
  }
  for (const Evaluated::Entity& entity : response.entities()) {
    rows.push_back(clicks ? ClicksRow(entity) : EntityRow(entity));
  }
  const auto add_group = [&](const std::string& name, const Evaluated::GroupScores& group) {
    rows.push_back(clicks ? ClicksGroupRow(name, group) : GroupRow(name, group));
  };
  for (const Evaluated::GroupScores& category : response.categories()) {
    if (category.num_entities() < 2) continue;
    add_group(absl::StrCat(category.name(), " (", category.num_entities(), ")"), category);
  }
  add_group(absl::StrCat("mean of ", response.entities_size()), response.scene());
  return rows;
}

// Returns the lines below the entities.
std::vector<std::string> FootOf(const Evaluated& response) {
  std::vector<std::string> lines;
  if (!CountsClicks(response)) {
    lines.push_back(
        "* scale and threshold chosen by the scored truth, as papers publish: an upper bound");
  }
  if (response.left_out_size() > 0) {
    lines.push_back(absl::StrCat("left out, without a view to score: ",
                                 absl::StrJoin(response.left_out(), ", ")));
  }
  if (response.num_void_pixels() > 0) {
    lines.push_back(absl::StrCat(response.num_void_pixels(),
                                 " void pixels of the label images were left out of all scores"));
  }
  const auto& ious = response.scene().iou_by_scale();
  if (ious.empty()) return lines;
  TableRow scales = {"one scale for all"}, means = {"mean IoU"};
  for (int k = 0; k < ious.size() && k < response.options().scales_size(); ++k) {
    scales.push_back(absl::StrFormat("%g", response.options().scales(k)));
    means.push_back(Number(ious[k]));
  }
  const std::vector<std::string> table = TextTable({scales, means});
  lines.emplace_back();
  lines.insert(lines.end(), table.begin(), table.end());
  return lines;
}

void AddScores(const std::string& choice, const Evaluated::Scores& scores,
               std::vector<std::pair<std::string, double>>& summary) {
  summary.emplace_back(choice + "_iou", scores.iou());
  summary.emplace_back(choice + "_accuracy", scores.accuracy());
  summary.emplace_back(choice + "_boundary_iou", scores.boundary_iou());
}

// The numbers of the summaries by name, in the order of the first summary that has them.
std::vector<std::pair<std::string, std::vector<double>>> Columns(
    std::span<const Evaluated> responses) {
  std::vector<std::pair<std::string, std::vector<double>>> columns;
  for (const Evaluated& response : responses) {
    for (const auto& [name, value] : SummaryOf(response)) {
      auto found = std::find_if(columns.begin(), columns.end(),
                                [&](const auto& column) { return column.first == name; });
      if (found == columns.end()) found = columns.insert(columns.end(), {name, {}});
      found->second.push_back(value);
    }
  }
  return columns;
}

}  // namespace

std::vector<std::string> EvaluationTable(const Evaluated& response) {
  std::vector<std::string> lines =
      response.has_sam_agreement() ? SamTable(response) : TextTable(EntityRows(response));
  lines.insert(lines.end(), response.notes().begin(), response.notes().end());
  if (response.has_sam_agreement()) return lines;
  const std::vector<std::string> foot = FootOf(response);
  lines.insert(lines.end(), foot.begin(), foot.end());
  return lines;
}

std::vector<std::pair<std::string, double>> SummaryOf(const Evaluated& response) {
  std::vector<std::pair<std::string, double>> summary;
  if (response.has_sam_agreement()) {
    summary.emplace_back("first_iou", response.sam_agreement().first_iou());
    summary.emplace_back("best_iou", response.sam_agreement().best_iou());
    return summary;
  }
  const Evaluated::GroupScores& scene = response.scene();
  if (CountsClicks(response)) {
    summary.emplace_back("num_clicks", scene.num_clicks());
    summary.emplace_back("reached", scene.reached());
    for (int k = 0; k < scene.iou_after_size(); ++k) {
      summary.emplace_back(absl::StrCat("iou_after_", k + 1), scene.iou_after(k));
    }
    return summary;
  }
  if (scene.has_reference()) AddScores("reference", scene.reference(), summary);
  AddScores("automatic", scene.automatic(), summary);
  AddScores("paper", scene.paper(), summary);
  return summary;
}

bool UsesScoredTruth(const std::string& name) {
  return name.starts_with("paper_") || name == "best_iou";
}

Spread SpreadOf(const std::vector<double>& values) {
  Spread spread;
  if (values.empty()) return spread;
  spread.count = static_cast<int>(values.size());
  spread.mean = std::accumulate(values.begin(), values.end(), 0.0) / spread.count;
  const auto [least, most] = std::minmax_element(values.begin(), values.end());
  spread.least = *least;
  spread.most = *most;
  if (spread.count < 2) return spread;
  double squares = 0;
  for (const double value : values) squares += (value - spread.mean) * (value - spread.mean);
  spread.deviation = std::sqrt(squares / (spread.count - 1));
  return spread;
}

std::vector<std::string> SpreadTable(std::span<const Evaluated> responses) {
  const auto columns = Columns(responses);
  std::vector<TableRow> rows = {{"model"}};
  for (const auto& [name, values] : columns) {
    rows[0].push_back(absl::StrReplaceAll(name, {{"_", " "}}) + (UsesScoredTruth(name) ? "*" : ""));
  }
  for (const Evaluated& response : responses) {
    const auto summary = SummaryOf(response);
    const std::map<std::string, double> by_name(summary.begin(), summary.end());
    TableRow& row = rows.emplace_back(TableRow{response.model()});
    for (const auto& [name, values] : columns) {
      row.push_back(by_name.contains(name) ? Number(by_name.at(name)) : "-");
    }
  }
  const auto add_row = [&](const std::string& name, double Spread::*number) {
    TableRow& row = rows.emplace_back(TableRow{name});
    for (const auto& [column, values] : columns) row.push_back(Number(SpreadOf(values).*number));
  };
  add_row("mean", &Spread::mean);
  add_row("standard deviation", &Spread::deviation);
  add_row("least", &Spread::least);
  add_row("most", &Spread::most);
  std::vector<std::string> lines = TextTable(rows);
  if (std::any_of(columns.begin(), columns.end(),
                  [](const auto& column) { return UsesScoredTruth(column.first); })) {
    lines.push_back("* chosen by the scored truth: an upper bound");
  }
  return lines;
}

nlohmann::ordered_json SpreadJson(std::span<const Evaluated> responses) {
  nlohmann::ordered_json json;
  json["evaluations"] = nlohmann::ordered_json::array();
  for (const Evaluated& response : responses) {
    json["evaluations"].push_back(nlohmann::ordered_json::parse(ToJson(response)));
  }
  for (const auto& [name, values] : Columns(responses)) {
    const Spread spread = SpreadOf(values);
    json["spread"][name] = {{"mean", spread.mean},   {"deviation", spread.deviation},
                            {"least", spread.least}, {"most", spread.most},
                            {"count", spread.count}, {"uses_scored_truth", UsesScoredTruth(name)}};
  }
  return json;
}

const std::map<std::string, v1::EvaluationProtocol>& ProtocolsByName() {
  static const auto& protocols = *new std::map<std::string, v1::EvaluationProtocol>{
      {"prompt", v1::EVALUATION_PROTOCOL_PROMPT},
      {"label-propagation", v1::EVALUATION_PROTOCOL_LABEL_PROPAGATION},
      {"label-propagation-pixels", v1::EVALUATION_PROTOCOL_LABEL_PROPAGATION_PIXELS},
      {"promptable", v1::EVALUATION_PROTOCOL_PROMPTABLE},
      {"clicks", v1::EVALUATION_PROTOCOL_CLICKS},
      {"sam-agreement", v1::EVALUATION_PROTOCOL_SAM_AGREEMENT}};
  return protocols;
}

std::string ProtocolName(v1::EvaluationProtocol protocol) {
  for (const auto& [name, named] : ProtocolsByName()) {
    if (named == protocol) return name;
  }
  return "";
}

}  // namespace pepeseg::client::cli
