#include "clients/benchmark/suite_table.h"

#include <algorithm>
#include <functional>
#include <iterator>
#include <map>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_replace.h"
#include "clients/benchmark/evaluation_table.h"
#include "clients/benchmark/suite_text.h"

namespace pepeseg::client::cli {
namespace {

// The choices of the scale, with the member that has their scores.
struct Choice {
  const char* name;
  RunScores LevelScores::*scores;
  const char* chosen_on;
};
constexpr Choice kChoices[] = {
    {"reference", &LevelScores::reference, "the reference view"},
    {"automatic", &LevelScores::automatic, "nothing"},
    {"paper*", &LevelScores::paper, "the scored views*"},
};
constexpr char kPublishedChoice[] = "the scored views*";

std::string Cell(const Spread& spread, int digits) {
  if (spread.count == 0) return "-";
  const std::string mean = absl::StrFormat("%.*f", digits, spread.mean);
  return spread.count < 2 ? mean : absl::StrFormat("%s +- %.*f", mean, digits, spread.deviation);
}

// A number of a run; nothing if it was not measured.
using RunNumber =
    std::function<bool(const ScoredRun& run, const LevelScores& level, double& value)>;
struct Column {
  std::string name;
  int digits;
  RunNumber number;
};

// Returns a column of a number that is 0 where it was not measured.
Column Plain(const char* name, int digits, double ScoredRun::*member, double factor = 1) {
  return {name, digits, [=](const ScoredRun& run, const LevelScores&, double& value) {
            value = run.*member * factor;
            return value != 0;
          }};
}

Column ScoreColumn(const Choice& choice, const char* name, double RunScores::*member) {
  return {absl::StrCat(name, " ", choice.name), 1,
          [=](const ScoredRun&, const LevelScores& level, double& value) {
            value = 100 * (level.*choice.scores).*member;
            return (level.*choice.scores).known;
          }};
}

Column Minutes(const char* name, const char* stage) {
  return {name, 1, [=](const ScoredRun& run, const LevelScores&, double& value) {
            value = 0;
            for (const auto& [other, seconds] : run.seconds) {
              if (*stage == '\0' || other == stage) value += seconds / 60;
            }
            return !run.seconds.empty();
          }};
}

Column Clicks(const char* name, int digits, double LevelScores::*member, double factor) {
  return {name, digits, [=](const ScoredRun&, const LevelScores& level, double& value) {
            value = level.*member * factor;
            return level.*member >= 0;
          }};
}

std::vector<Column> TableColumns() {
  std::vector<Column> columns;
  for (const Choice& choice : kChoices) {
    columns.push_back(ScoreColumn(choice, "mIoU", &RunScores::iou));
    columns.push_back(ScoreColumn(choice, "mAcc", &RunScores::accuracy));
    columns.push_back(ScoreColumn(choice, "mBIoU", &RunScores::boundary_iou));
  }
  columns.push_back(Clicks("clicks to 90", 2, &LevelScores::num_clicks, 1));
  columns.push_back(Clicks("reached 90 %", 1, &LevelScores::reached, 100));
  columns.push_back(Plain("SAM first IoU", 1, &ScoredRun::sam_first_iou, 100));
  columns.push_back(Plain("SAM best IoU", 1, &ScoredRun::sam_best_iou, 100));
  columns.push_back(Plain("PSNR", 2, &ScoredRun::psnr));
  columns.push_back(Plain("SSIM", 4, &ScoredRun::ssim));
  columns.push_back(Plain("LPIPS", 4, &ScoredRun::lpips));
  columns.push_back(Minutes("reconstruct min", "reconstruct"));
  columns.push_back(Minutes("features min", "features"));
  columns.push_back(Minutes("all stages min", ""));
  constexpr double kGib = 1.0 / (1 << 30);
  columns.push_back(Plain("host GiB", 2, &ScoredRun::host_bytes, kGib));
  columns.push_back(Plain("device GiB", 2, &ScoredRun::device_bytes, kGib));
  columns.push_back(Plain("query ms", 1, &ScoredRun::query_ms));
  return columns;
}

// Values by variant, by row (scene and level), by seed.
using Values = std::map<std::string, std::map<std::string, std::map<int, double>>>;

Values RunValues(std::span<const ScoredRun> runs, const Column& column) {
  Values values;
  for (const ScoredRun& run : runs) {
    for (const LevelScores& level : run.levels) {
      const std::string row =
          level.name.empty() ? run.scene : absl::StrCat(run.scene, " ", level.name);
      double value = 0;
      if (column.number(run, level, value)) values[run.variant][row][run.seed] = value;
    }
  }
  return values;
}

// Returns the spread over seeds of a row.
Spread RowSpread(const std::map<std::string, std::map<int, double>>& rows, const std::string& row) {
  std::vector<double> values;
  const auto found = rows.find(row);
  if (found == rows.end()) return {};
  for (const auto& [seed, value] : found->second) values.push_back(value);
  return SpreadOf(values);
}

// Returns the spread over seeds of the mean of `num_rows` rows. A seed that not all of them have is
// left out, so that no mean is one of other scenes.
Spread MeanSpread(const std::map<std::string, std::map<int, double>>& rows, size_t num_rows) {
  std::map<int, std::vector<double>> by_seed;
  for (const auto& [name, seeds] : rows) {
    for (const auto& [seed, value] : seeds) by_seed[seed].push_back(value);
  }
  std::vector<double> means;
  for (const auto& [seed, values] : by_seed) {
    if (values.size() == num_rows) means.push_back(SpreadOf(values).mean);
  }
  return SpreadOf(means);
}

// Returns the rows' names by variant, in the order of the runs.
std::vector<std::pair<std::string, std::vector<std::string>>> RowNames(
    std::span<const ScoredRun> runs) {
  std::vector<std::pair<std::string, std::vector<std::string>>> names;
  for (const ScoredRun& run : runs) {
    auto variant = std::find_if(names.begin(), names.end(),
                                [&](const auto& known) { return known.first == run.variant; });
    if (variant == names.end()) {
      names.emplace_back(run.variant, std::vector<std::string>());
      variant = std::prev(names.end());
    }
    for (const LevelScores& level : run.levels) {
      const std::string row =
          level.name.empty() ? run.scene : absl::StrCat(run.scene, " ", level.name);
      auto& rows = variant->second;
      if (std::find(rows.begin(), rows.end(), row) == rows.end()) rows.push_back(row);
    }
  }
  return names;
}

constexpr PublishedRow kSpinNerf[] = {{"PePESeg3D", 92.3, 98.9, -1},
                                      {"SAGA", 91.9, -1, -1},
                                      {"Unified-Lift", 85.0, -1, -1},
                                      {"Gaussian Grouping", 84.9, -1, -1},
                                      {"OmniSeg3D-GS", 82.5, -1, -1}};
constexpr PublishedRow kNvos[] = {
    {"PePESeg3D", 92.2, 98.5, -1}, {"OmniSeg3D", 91.7, -1, -1},         {"SAGA", 91.5, -1, -1},
    {"SA3D", 90.3, -1, -1},        {"Gaussian Grouping", 85.6, -1, -1}, {"ISRF", 83.8, -1, -1},
    {"NVOS", 70.1, 92.0, -1}};
constexpr PublishedRow kLerfMask[] = {
    {"OpenSplat3D", 83.5, -1, -1},      {"Unified-Lift", 80.9, -1, -1},
    {"PePESeg3D", 80.5, -1, 76.5},      {"SAGA", 78.4, -1, -1},
    {"OmniSeg3D-GS", 74.7, -1, -1},     {"Gaga", 74.7, -1, -1},
    {"Gaussian Grouping", 72.8, -1, -1}};
constexpr PublishedRow kLerfMaskFine[] = {
    {"PePESeg3D", 70.8, -1, 68.3}, {"SAGA", 69.6, -1, -1},         {"OmniSeg3D-GS", 39.8, -1, -1},
    {"CCL-LGS", 23.1, -1, -1},     {"Unified-Lift", 16.0, -1, -1}, {"OpenSplat3D", 15.0, -1, -1}};

std::string PublishedCell(double value) { return value < 0 ? "-" : absl::StrFormat("%.1f", value); }

}  // namespace

std::span<const PublishedRow> PublishedRows(Benchmark benchmark) {
  switch (benchmark) {
    case Benchmark::kSpinNerf:
      return kSpinNerf;
    case Benchmark::kNvos:
      return kNvos;
    case Benchmark::kLerfMask:
      return kLerfMask;
    case Benchmark::kLerfMaskFine:
      return kLerfMaskFine;
    case Benchmark::kScene:
      break;
  }
  return {};
}

std::string LineOf(const ScoredRun& run) {
  std::string line = run.scene;
  if (!run.variant.empty()) absl::StrAppend(&line, ", ", run.variant);
  absl::StrAppendFormat(&line, ", seed %d: %.2f dB, SSIM %.4f", run.seed, run.psnr, run.ssim);
  for (const LevelScores& level : run.levels) {
    if (!level.name.empty()) absl::StrAppend(&line, "; ", level.name);
    const char* separator = "; IoU";
    for (const Choice& choice : kChoices) {
      const RunScores& scores = level.*choice.scores;
      if (!scores.known) continue;
      absl::StrAppendFormat(&line, "%s %.1f %s", std::exchange(separator, ","), 100 * scores.iou,
                            choice.name);
    }
    if (level.num_clicks >= 0) absl::StrAppendFormat(&line, ", %.2f clicks", level.num_clicks);
  }
  if (run.sam_masks > 0) {
    absl::StrAppendFormat(&line, "; SAM %.1f first, %.1f best of %d masks", 100 * run.sam_first_iou,
                          100 * run.sam_best_iou, run.sam_masks);
  }
  return line;
}

std::vector<TableRow> SceneTable(std::span<const ScoredRun> runs) {
  const auto names = RowNames(runs);
  const bool varied = names.size() > 1;
  TableRow header = {"scene"};
  if (varied) header.insert(header.begin(), "variant");
  std::vector<TableRow> rows;
  for (const auto& [variant, scenes] : names) {
    std::vector<std::string> all = scenes;
    if (scenes.size() > 1) all.emplace_back();  // the mean
    for (const std::string& scene : all) {
      TableRow& row = rows.emplace_back();
      if (varied) row.push_back(variant.empty() ? "plain" : variant);
      row.push_back(scene.empty() ? absl::StrCat("mean of ", scenes.size()) : scene);
    }
  }
  for (const Column& column : TableColumns()) {
    const Values values = RunValues(runs, column);
    if (values.empty()) continue;  // nothing of it was measured
    header.push_back(column.name);
    size_t at = 0;
    for (const auto& [variant, scenes] : names) {
      const auto found = values.find(variant);
      const size_t count = scenes.size() + (scenes.size() > 1 ? 1 : 0);
      for (size_t i = 0; i < count; ++i) {
        Spread spread;
        if (found != values.end()) {
          spread = i < scenes.size() ? RowSpread(found->second, scenes[i])
                                     : MeanSpread(found->second, scenes.size());
        }
        rows[at++].push_back(Cell(spread, column.digits));
      }
    }
  }
  rows.insert(rows.begin(), header);
  return rows;
}

std::vector<TableRow> PublishedTable(Benchmark benchmark, std::span<const ScoredRun> runs) {
  const std::span<const PublishedRow> published = PublishedRows(benchmark);
  if (published.empty()) return {};
  std::vector<ScoredRun> plain;
  for (const ScoredRun& run : runs) {
    if (run.variant.empty()) plain.push_back(run);
  }
  const auto names = RowNames(plain);
  const size_t num_rows = names.empty() ? 0 : names[0].second.size();
  std::vector<std::pair<double, TableRow>> ranked;  // by mIoU
  for (const PublishedRow& row : published) {
    ranked.push_back({row.iou,
                      {row.method, kPublishedChoice, PublishedCell(row.iou),
                       PublishedCell(row.accuracy), PublishedCell(row.boundary_iou)}});
  }
  double best = 0;  // of the numbers that may be in bold, if it beats all others
  for (const auto& [iou, row] : ranked) best = std::max(best, iou);
  for (const Choice& choice : kChoices) {
    TableRow row = {"pepeseg (this run)", choice.chosen_on};
    double iou = -1;
    for (double RunScores::*member :
         {&RunScores::iou, &RunScores::accuracy, &RunScores::boundary_iou}) {
      const Values values = RunValues(plain, ScoreColumn(choice, "", member));
      const auto found = values.find("");
      const Spread spread = found == values.end() ? Spread() : MeanSpread(found->second, num_rows);
      if (member == &RunScores::iou && spread.count > 0) iou = spread.mean;
      row.push_back(Cell(spread, 1));
    }
    if (iou < 0) continue;
    if (choice.chosen_on != std::string(kPublishedChoice) && iou > best) {
      best = iou;
      for (auto& [other, other_row] : ranked) {
        other_row[2] = absl::StrReplaceAll(other_row[2], {{"**", ""}});
      }
      row[2] = absl::StrCat("**", row[2], "**");
    }
    ranked.emplace_back(iou, std::move(row));
  }
  std::stable_sort(ranked.begin(), ranked.end(),
                   [](const auto& a, const auto& b) { return a.first > b.first; });
  std::vector<TableRow> rows = {{"method", "scale chosen on", "mIoU", "mAcc", "mBIoU"}};
  for (auto& [iou, row] : ranked) rows.push_back(std::move(row));
  return rows;
}

std::string PublishedCaveat(Benchmark benchmark, std::span<const ScoredRun> runs) {
  if (benchmark != Benchmark::kLerfMask) return "";
  if (!runs.empty() && runs[0].protocol == kTextProtocol) {
    return "The prompt of pepeseg is the name of the entity, which the server's sources of words "
           "answer; an entity that they do not find counts as 0.";
  }
  return "The prompt of pepeseg is the true mask of the first test view that shows the entity, an "
         "easier prompt than the text of the published rows.";
}

std::string Markdown(const std::vector<TableRow>& rows) {
  std::string text;
  for (size_t i = 0; i < rows.size(); ++i) {
    absl::StrAppend(&text, "| ", absl::StrJoin(rows[i], " | "), " |\n");
    if (i > 0) continue;
    for (size_t k = 0; k < rows[0].size(); ++k) absl::StrAppend(&text, "|---");
    absl::StrAppend(&text, "|\n");
  }
  return text;
}

std::string Csv(const std::vector<TableRow>& rows) {
  std::string text;
  for (const TableRow& row : rows) {
    for (size_t i = 0; i < row.size(); ++i) {
      const bool quoted = row[i].find_first_of(",\"\n") != std::string::npos;
      const std::string cell = absl::StrReplaceAll(row[i], {{"\"", "\"\""}});
      absl::StrAppend(&text, i == 0 ? "" : ",", quoted ? absl::StrCat("\"", cell, "\"") : cell);
    }
    absl::StrAppend(&text, "\n");
  }
  return text;
}

std::string ReportMarkdown(Benchmark benchmark, std::span<const ScoredRun> runs) {
  std::string text = absl::StrCat("# ", NameOf(benchmark), "\n\n");
  if (!runs.empty()) {
    absl::StrAppend(&text, "Protocol ", runs[0].protocol, "; ", runs[0].options, "; ",
                    runs[0].device, ".\n\n");
  }
  absl::StrAppend(&text, Markdown(SceneTable(runs)),
                  "\nreference: the scale was chosen on the reference view; automatic: without any "
                  "truth; paper\\*: on the truth of the scored views, as papers publish it, which "
                  "no user can. IoU, accuracy and boundary IoU are percentages; +- is the standard "
                  "deviation over seeds.\n");
  const std::vector<TableRow> published = PublishedTable(benchmark, runs);
  if (published.empty()) return text;
  absl::StrAppend(&text, "\n## Next to published results\n\n", Markdown(published),
                  "\n\\* The scale was chosen on the truth of the scored views. Published numbers "
                  "are those of the papers, not measured here. A number is in bold if it is the "
                  "best of all and used no scored truth.\n");
  const std::string caveat = PublishedCaveat(benchmark, runs);
  if (!caveat.empty()) absl::StrAppend(&text, "\n", caveat, "\n");
  return text;
}

}  // namespace pepeseg::client::cli
