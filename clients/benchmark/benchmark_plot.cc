#include "clients/benchmark/benchmark_plot.h"

#include <algorithm>
#include <iterator>
#include <map>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "clients/benchmark/evaluation_table.h"

namespace pepeseg::client::cli {
namespace {

// Sizes in pixels.
constexpr double kNameWidth = 210, kBarsWidth = 400, kValueWidth = 110, kMargin = 16;
constexpr double kWidth = kMargin + kNameWidth + kBarsWidth + kValueWidth;
constexpr double kBarHeight = 12, kRowGap = 6, kLineHeight = 18;
constexpr double kLeft = kMargin + kNameWidth;  // of the bars
constexpr size_t kMaxNameCharacters = 32;
constexpr size_t kMaxSeriesWithEntities = 4;
// Colours that people with a colour deficiency can tell apart (Okabe and Ito).
constexpr const char* kSeriesColors[] = {"#0072b2", "#e69f00", "#009e73", "#cc79a7",
                                         "#56b4e9", "#d55e00", "#999999"};

// A choice of the scale, with the members that have its IoU.
struct PlottedChoice {
  const char* text;
  double EntityIou::*entity;
  RunScores LevelScores::*mean;
};
constexpr PlottedChoice kPlottedChoices[] = {
    {"automatic: the scale was chosen without any truth", &EntityIou::automatic,
     &LevelScores::automatic},
    {"reference: the scale was chosen on the reference view", &EntityIou::reference,
     &LevelScores::reference},
    {"paper*: the scale was chosen on the truth of the scored views", &EntityIou::paper,
     &LevelScores::paper},
};

// The runs whose bars have one colour.
struct PlotSeries {
  std::string variant, options, label;
  std::vector<const ScoredRun*> runs;
};

// Bars next to one name: one a series.
struct PlotRow {
  std::string name;
  bool mean = false;            // of all entities
  std::vector<Spread> spreads;  // percent, by series; count 0: no bar
};
struct PlotPanel {
  std::string scene;
  std::vector<PlotRow> rows;
};

std::vector<PlotSeries> SeriesOf(std::span<const ScoredRun> runs) {
  std::vector<PlotSeries> all;
  for (const ScoredRun& run : runs) {
    auto found = std::find_if(all.begin(), all.end(), [&](const PlotSeries& series) {
      return series.variant == run.variant && series.options == run.options;
    });
    if (found == all.end()) found = all.insert(all.end(), {run.variant, run.options, "", {}});
    found->runs.push_back(&run);
  }
  const bool same_options = std::all_of(all.begin(), all.end(), [&](const PlotSeries& series) {
    return series.options == all[0].options;
  });
  for (PlotSeries& series : all) {
    const std::string variant = series.variant.empty() ? "plain" : series.variant;
    series.label = same_options             ? variant
                   : series.variant.empty() ? series.options
                                            : absl::StrCat(series.options, ", ", variant);
  }
  return all;
}

// Returns the first choice that a run has scores of; null: no run has any.
const PlottedChoice* ChoiceOf(std::span<const ScoredRun> runs) {
  for (const PlottedChoice& choice : kPlottedChoices) {
    for (const ScoredRun& run : runs) {
      for (const LevelScores& level : run.levels) {
        if ((level.*choice.mean).known) return &choice;
      }
    }
  }
  return nullptr;
}

// Values over seeds, percent, by name of the entity ("": the mean) and series.
using SceneValues = std::map<std::string, std::vector<std::vector<double>>>;

// Returns the rows of a scene: the entities by the mean of the first series that has them, the best
// first, then the mean.
std::vector<PlotRow> RowsOf(const SceneValues& values, bool with_entities) {
  std::vector<PlotRow> rows;
  for (const auto& [name, by_series] : values) {
    if (!with_entities && !name.empty()) continue;
    PlotRow& row = rows.emplace_back();
    row.mean = name.empty();
    row.name = row.mean ? "mean" : name;
    for (const std::vector<double>& seeds : by_series) row.spreads.push_back(SpreadOf(seeds));
  }
  const auto rank = [](const PlotRow& row) {
    const auto first = std::find_if(row.spreads.begin(), row.spreads.end(),
                                    [](const Spread& spread) { return spread.count > 0; });
    return std::pair(row.mean, first == row.spreads.end() ? 0.0 : -first->mean);
  };
  std::stable_sort(rows.begin(), rows.end(),
                   [&](const PlotRow& a, const PlotRow& b) { return rank(a) < rank(b); });
  return rows;
}

std::vector<PlotPanel> PanelsOf(const std::vector<PlotSeries>& series,
                                const PlottedChoice& choice) {
  std::map<std::string, SceneValues> scenes;
  for (size_t i = 0; i < series.size(); ++i) {
    for (const ScoredRun* run : series[i].runs) {
      for (const LevelScores& level : run->levels) {
        const std::string scene =
            level.name.empty() ? run->scene : absl::StrCat(run->scene, " ", level.name);
        const auto add = [&](const std::string& name, double iou) {
          auto& by_series = scenes[scene][name];
          by_series.resize(series.size());
          by_series[i].push_back(100 * iou);
        };
        for (const EntityIou& entity : level.entities) {
          if (entity.*choice.entity >= 0) add(entity.name, entity.*choice.entity);
        }
        if ((level.*choice.mean).known) add("", (level.*choice.mean).iou);
      }
    }
  }
  std::vector<PlotPanel> panels;
  for (const auto& [scene, values] : scenes) {
    panels.push_back({scene, RowsOf(values, series.size() <= kMaxSeriesWithEntities)});
  }
  return panels;
}

// Returns text as XML has it. Control characters, which XML lacks, become "?".
std::string XmlText(const std::string& text) {
  std::string escaped;
  for (const char c : text) {
    switch (c) {
      case '&':
        escaped += "&amp;";
        break;
      case '<':
        escaped += "&lt;";
        break;
      case '>':
        escaped += "&gt;";
        break;
      case '"':
        escaped += "&quot;";
        break;
      default:
        escaped += static_cast<unsigned char>(c) < 0x20 ? '?' : c;
    }
  }
  return escaped;
}

// Cuts a name to its first characters. Its bytes are UTF-8: no character is cut in two.
std::string CutName(const std::string& name) {
  size_t characters = 0;
  for (size_t i = 0; i < name.size(); ++i) {
    if ((static_cast<unsigned char>(name[i]) & 0xc0) == 0x80) continue;  // not the first byte
    if (characters++ == kMaxNameCharacters) return name.substr(0, i) + "...";
  }
  return name;
}

std::string SpreadText(const Spread& spread) {
  const std::string mean = absl::StrFormat("%.1f", spread.mean);
  return spread.count < 2 ? mean : absl::StrFormat("%s +- %.1f", mean, spread.deviation);
}

// The elements of the plot, from top to bottom.
class PlotText {
 public:
  // Adds a line of text. `size`: of the font.
  void AddLine(const std::string& text, int size) {
    y_ += kLineHeight;
    AddText(kMargin, y_, text, absl::StrFormat("font-size=\"%d\"", size));
  }

  void AddLegend(const std::vector<PlotSeries>& series) {
    for (size_t i = 0; i < series.size(); ++i) {
      absl::StrAppendFormat(&body_,
                            "<rect x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\" "
                            "fill=\"%s\"/>\n",
                            kMargin, y_ + kLineHeight - kBarHeight + 2, kBarHeight, kBarHeight,
                            Color(i));
      y_ += kLineHeight;
      AddText(kMargin + kLineHeight, y_, series[i].label, "");
    }
  }

  void AddPanel(const PlotPanel& panel, const std::vector<PlotSeries>& series) {
    y_ += kLineHeight / 2;
    AddLine(panel.scene, 14);
    y_ += kRowGap;
    const double top = y_;
    for (const PlotRow& row : panel.rows) AddRow(panel.scene, row, series);
    for (const int percent : {0, 25, 50, 75, 100}) {
      const double x = kLeft + kBarsWidth * percent / 100;
      absl::StrAppendFormat(&body_,
                            "<line x1=\"%.1f\" y1=\"%.1f\" x2=\"%.1f\" y2=\"%.1f\" "
                            "stroke=\"#000000\" stroke-opacity=\"0.25\"/>\n",
                            x, top, x, y_);
      AddText(x, y_ + kLineHeight - 4, absl::StrCat(percent), "text-anchor=\"middle\"");
    }
    y_ += kLineHeight;
  }

  std::string Svg(const std::string& title) const {
    const double height = y_ + kMargin;
    return absl::StrFormat(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"%.0f\" height=\"%.0f\" "
        "viewBox=\"0 0 %.0f %.0f\" font-family=\"sans-serif\" font-size=\"12\" fill=\"#222222\">\n"
        "<title>%s</title>\n<rect width=\"100%%\" height=\"100%%\" fill=\"#ffffff\"/>\n%s</svg>\n",
        kWidth, height, kWidth, height, XmlText(title), body_);
  }

 private:
  static const char* Color(size_t series) {
    return kSeriesColors[series % std::size(kSeriesColors)];
  }

  void AddText(double x, double y, const std::string& text, const std::string& attributes) {
    absl::StrAppendFormat(&body_, "<text x=\"%.1f\" y=\"%.1f\" %s>%s</text>\n", x, y, attributes,
                          XmlText(text));
  }

  void AddRow(const std::string& scene, const PlotRow& row, const std::vector<PlotSeries>& series) {
    const double middle = y_ + kBarHeight * static_cast<double>(series.size()) / 2;
    AddText(kLeft - kRowGap, middle + 4, CutName(row.name),
            row.mean ? "text-anchor=\"end\" font-weight=\"bold\"" : "text-anchor=\"end\"");
    for (size_t i = 0; i < series.size(); ++i, y_ += kBarHeight) {
      const Spread& spread = row.spreads[i];
      if (spread.count == 0) continue;
      const std::string text = SpreadText(spread);
      absl::StrAppendFormat(
          &body_,
          "<rect class=\"bar\" x=\"%.1f\" y=\"%.1f\" width=\"%.2f\" height=\"%.1f\" fill=\"%s\">"
          "<title>%s</title></rect>\n",
          kLeft, y_ + 1, Length(spread.mean), kBarHeight - 2, Color(i),
          XmlText(absl::StrCat(scene, ", ", row.name, ", ", series[i].label, ": ", text)));
      if (spread.count > 1) AddWhisker(spread, y_ + kBarHeight / 2);
      AddText(kLeft + kBarsWidth + 2 * kRowGap, y_ + kBarHeight - 2, text, "");
    }
    y_ += kRowGap;
  }

  // Adds a line of one deviation on both sides of the mean, within the axis.
  void AddWhisker(const Spread& spread, double y) {
    const double from = kLeft + Length(std::max(0.0, spread.mean - spread.deviation));
    const double to = kLeft + Length(std::min(100.0, spread.mean + spread.deviation));
    absl::StrAppendFormat(&body_,
                          "<path class=\"whisker\" d=\"M%.2f %.1f H%.2f M%.2f %.1f v6 M%.2f %.1f "
                          "v6\" stroke=\"#000000\" fill=\"none\"/>\n",
                          from, y, to, from, y - 3, to, y - 3);
  }

  static double Length(double percent) { return kBarsWidth * percent / 100; }

  double y_ = 0;  // bottom of what was added
  std::string body_;
};

}  // namespace

std::string EntityPlot(Benchmark benchmark, std::span<const ScoredRun> runs) {
  const PlottedChoice* choice = ChoiceOf(runs);
  if (choice == nullptr) return "";
  const std::vector<PlotSeries> series = SeriesOf(runs);
  const std::string title = absl::StrCat(NameOf(benchmark), ": IoU of entities, percent");
  PlotText plot;
  plot.AddLine(title, 16);
  plot.AddLine(absl::StrCat("Protocol ", runs[0].protocol, "; ", choice->text), 12);
  const bool means = series.size() > kMaxSeriesWithEntities;
  const bool seeds = std::any_of(series.begin(), series.end(), [](const PlotSeries& one) {
    return std::any_of(one.runs.begin(), one.runs.end(),
                       [&](const ScoredRun* run) { return run->seed != one.runs[0]->seed; });
  });
  if (seeds) plot.AddLine("Bars: means over seeds; whiskers: one standard deviation", 12);
  if (means) plot.AddLine("Means of entities only: more than 4 trainings are compared", 12);
  if (series.size() > 1) plot.AddLegend(series);
  for (const PlotPanel& panel : PanelsOf(series, *choice)) plot.AddPanel(panel, series);
  return plot.Svg(title);
}

}  // namespace pepeseg::client::cli
