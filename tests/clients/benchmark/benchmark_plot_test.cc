#include "clients/benchmark/benchmark_plot.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <regex>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"

namespace pepeseg::client::cli {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

ScoredRun RunOf(const std::string& scene, int seed, std::vector<EntityIou> entities) {
  ScoredRun run;
  run.benchmark = "lerf-mask";
  run.scene = scene;
  run.seed = seed;
  run.protocol = "label-propagation";
  run.options = "preset=best";
  LevelScores level;
  level.automatic = {true, 0, 0, 0};
  for (const EntityIou& entity : entities) {
    level.automatic.iou += entity.automatic / static_cast<double>(entities.size());
  }
  level.entities = std::move(entities);
  run.levels = {level};
  return run;
}

EntityIou Iou(const std::string& name, double automatic) { return {name, 1, 0.9, automatic}; }

// A bar with the text that a pointer over it shows.
struct Bar {
  std::string text;
  double width = 0;
};

std::vector<Bar> BarsOf(const std::string& svg) {
  static const std::regex kBar(
      "<rect class=\"bar\"[^>]* width=\"([0-9.]+)\"[^>]*><title>([^<]*)</title></rect>");
  std::vector<Bar> bars;
  for (std::sregex_iterator match(svg.begin(), svg.end(), kBar), end; match != end; ++match) {
    Bar& bar = bars.emplace_back();
    bar.text = (*match)[2];
    EXPECT_TRUE(absl::SimpleAtod((*match)[1].str(), &bar.width));
  }
  return bars;
}

std::vector<std::string> TextsOf(const std::vector<Bar>& bars) {
  std::vector<std::string> texts;
  for (const Bar& bar : bars) texts.push_back(bar.text);
  return texts;
}

// Returns what is wrong with an XML document; "" if it is well-formed. It knows what an SVG without
// comments and declarations has.
std::string XmlFault(const std::string& xml) {
  static const std::regex kTag("<(/?)([a-z]+)((?: [A-Za-z0-9-]+=\"[^\"<]*\")*) ?(/?)>");
  static const std::regex kText("([^<>&]|&(amp|lt|gt|quot);)*");
  std::vector<std::string> open;
  size_t at = 0;
  for (std::sregex_iterator tag(xml.begin(), xml.end(), kTag), end; tag != end; ++tag) {
    const auto begin = static_cast<size_t>(tag->position());
    const std::string between = xml.substr(at, begin - at);
    if (!std::regex_match(between, kText)) return "text: " + between;
    const std::string name = (*tag)[2];
    if ((*tag)[1].length() > 0) {
      if (open.empty() || open.back() != name) return "closes " + name;
      open.pop_back();
    } else if ((*tag)[4].length() == 0) {
      open.push_back(name);
    }
    at = begin + static_cast<size_t>(tag->length());
  }
  if (xml.substr(at) != "\n") return "after the last tag: " + xml.substr(at);
  return open.empty() ? "" : "leaves open " + open.back();
}

TEST(EntityPlot, HasABarAsLongAsItsValueTheBestFirst) {
  const std::vector<ScoredRun> runs = {
      RunOf("ramen", 1, {Iou("egg", 0.25), Iou("spoon", 0), Iou("bowl", 1)})};
  const std::string svg = EntityPlot(Benchmark::kLerfMask, runs);
  const std::vector<Bar> bars = BarsOf(svg);
  EXPECT_THAT(TextsOf(bars), ElementsAre("ramen, bowl, plain: 100.0", "ramen, egg, plain: 25.0",
                                         "ramen, spoon, plain: 0.0", "ramen, mean, plain: 41.7"));
  EXPECT_DOUBLE_EQ(bars[1].width, 0.25 * bars[0].width);
  EXPECT_DOUBLE_EQ(bars[2].width, 0);
  EXPECT_NEAR(bars[3].width, bars[0].width * 1.25 / 3, 0.005);
  EXPECT_THAT(svg, HasSubstr("lerf-mask: IoU of entities, percent"));
  EXPECT_THAT(svg, HasSubstr("Protocol label-propagation; automatic: "));
  EXPECT_THAT(svg, Not(HasSubstr("class=\"whisker\""))) << "there is one seed";
}

TEST(EntityPlot, IsWellFormedWhateverTheNames) {
  const std::string bell(1, '\a');
  const std::vector<ScoredRun> runs = {
      RunOf("a < b & c", 1, {Iou("\"quoted\" <b>", 0.5), Iou("bell" + bell, 0.4)})};
  const std::string svg = EntityPlot(Benchmark::kLerfMask, runs);
  EXPECT_EQ(XmlFault(svg), "");
  EXPECT_THAT(svg, HasSubstr("&quot;quoted&quot; &lt;b&gt;"));
  EXPECT_THAT(svg, HasSubstr("bell?"));
  // The check finds faults.
  EXPECT_EQ(XmlFault("<svg><text>a</svg>\n"), "closes svg");
  EXPECT_EQ(XmlFault("<svg>a & b</svg>\n"), "text: a & b");
  EXPECT_EQ(XmlFault("<svg><g></g>\n"), "leaves open svg");
}

TEST(EntityPlot, CutsLongNamesBetweenCharacters) {
  std::string name;
  for (int i = 0; i < 40; ++i) name += "\xc3\xa9";  // é
  const std::vector<ScoredRun> runs = {RunOf("ramen", 1, {Iou(name, 0.5)})};
  const std::string svg = EntityPlot(Benchmark::kLerfMask, runs);
  EXPECT_THAT(svg, HasSubstr(">" + name.substr(0, 64) + "...</text>"));
  EXPECT_THAT(svg, HasSubstr(absl::StrCat("ramen, ", name, ", plain: 50.0")));
}

TEST(EntityPlot, HasMeanAndDeviationOverSeeds) {
  const std::vector<ScoredRun> runs = {RunOf("ramen", 1, {Iou("egg", 0.6)}),
                                       RunOf("ramen", 2, {Iou("egg", 0.8)}),
                                       RunOf("ramen", 3, {Iou("egg", 0.7)})};
  const std::string svg = EntityPlot(Benchmark::kLerfMask, runs);
  const std::vector<Bar> bars = BarsOf(svg);
  EXPECT_THAT(TextsOf(bars),
              ElementsAre("ramen, egg, plain: 70.0 +- 10.0", "ramen, mean, plain: 70.0 +- 10.0"));
  static const std::regex kWhisker("class=\"whisker\" d=\"M([0-9.]+) [0-9.]+ H([0-9.]+) ");
  std::smatch whisker;
  ASSERT_TRUE(std::regex_search(svg, whisker, kWhisker));
  // From 60 to 80 %: a fifth of the axis, around the bar's end.
  EXPECT_NEAR(std::stod(whisker[2]) - std::stod(whisker[1]), bars[0].width * 20 / 70, 0.02);
  EXPECT_THAT(svg, HasSubstr("whiskers: one standard deviation"));
}

TEST(EntityPlot, PutsPresetsAndVariantsSideBySide) {
  ScoredRun best = RunOf("ramen", 1, {Iou("egg", 0.6), Iou("bowl", 0.7)});
  ScoredRun standard = RunOf("ramen", 1, {Iou("egg", 0.5), Iou("bowl", 0.3)});
  standard.options = "preset=standard";
  ScoredRun varied = RunOf("ramen", 1, {Iou("egg", 0.4), Iou("plate", 0.2)});
  varied.variant = "k = 8";
  const std::string svg =
      EntityPlot(Benchmark::kLerfMask, std::vector<ScoredRun>{best, standard, varied});
  EXPECT_THAT(
      TextsOf(BarsOf(svg)),
      ElementsAre("ramen, bowl, preset=best: 70.0", "ramen, bowl, preset=standard: 30.0",
                  "ramen, egg, preset=best: 60.0", "ramen, egg, preset=standard: 50.0",
                  "ramen, egg, preset=best, k = 8: 40.0", "ramen, plate, preset=best, k = 8: 20.0",
                  "ramen, mean, preset=best: 65.0", "ramen, mean, preset=standard: 40.0",
                  "ramen, mean, preset=best, k = 8: 30.0"));
  EXPECT_THAT(svg, HasSubstr(">preset=standard</text>")) << "in the legend";
  EXPECT_EQ(XmlFault(svg), "");
}

TEST(EntityPlot, HasOnlyMeansOfManyVariants) {
  std::vector<ScoredRun> runs;
  for (int k = 0; k < 5; ++k) {
    runs.push_back(RunOf("ramen", 1, {Iou("egg", 0.1 * k)}));
    runs.back().variant = absl::StrCat("k = ", k);
  }
  const std::vector<Bar> bars = BarsOf(EntityPlot(Benchmark::kLerfMask, runs));
  ASSERT_EQ(bars.size(), 5u);
  EXPECT_EQ(bars[4].text, "ramen, mean, k = 4: 40.0");
}

TEST(EntityPlot, NeverMixesChoicesOfTheScale) {
  ScoredRun chosen = RunOf("ramen", 1, {Iou("egg", 0.6)});
  ScoredRun other = RunOf("sofa", 1, {Iou("cat", -1)});  // without an automatic choice
  other.levels[0].automatic.known = false;
  other.levels[0].paper = {true, 0.9, 0, 0};
  EXPECT_THAT(
      TextsOf(BarsOf(EntityPlot(Benchmark::kLerfMask, std::vector<ScoredRun>{chosen, other}))),
      ElementsAre("ramen, egg, plain: 60.0", "ramen, mean, plain: 60.0"));
  const std::string svg = EntityPlot(Benchmark::kLerfMask, std::vector<ScoredRun>{other});
  EXPECT_THAT(svg, HasSubstr("paper*: the scale was chosen on the truth"));
  EXPECT_THAT(TextsOf(BarsOf(svg)),
              ElementsAre("sofa, cat, plain: 100.0", "sofa, mean, plain: 90.0"));
}

TEST(EntityPlot, IsEmptyWithoutScores) {
  ScoredRun run = RunOf("ramen", 1, {});
  run.levels.clear();
  EXPECT_THAT(EntityPlot(Benchmark::kLerfMask, std::vector<ScoredRun>{run}), IsEmpty());
}

}  // namespace
}  // namespace pepeseg::client::cli
