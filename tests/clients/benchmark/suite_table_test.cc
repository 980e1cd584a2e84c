#include "clients/benchmark/suite_table.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>

#include "clients/benchmark/suite_text.h"
#include "clients/benchmark/suite_variants.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg::client::cli {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

ScoredRun MakeRun(const std::string& scene, int seed, double reference, double paper) {
  ScoredRun run;
  run.benchmark = "spin-nerf";
  run.scene = scene;
  run.seed = seed;
  run.protocol = "label-propagation";
  run.options = "preset=best";
  run.psnr = 26;
  run.seconds = {{"reconstruct", 60}, {"features", 120}, {"prepare", 6}};
  LevelScores level;
  level.reference = {true, reference, 0.98, 0.7};
  level.automatic = {true, reference - 0.1, 0.97, 0.6};
  level.paper = {true, paper, 0.99, 0.8};
  run.levels = {level};
  return run;
}

// Returns the cell of a table by its row's first cells and the name of its column.
std::string CellOf(const std::vector<TableRow>& rows, const std::string& row,
                   const std::string& column) {
  const auto at = std::find(rows[0].begin(), rows[0].end(), column);
  for (const TableRow& each : rows) {
    if (each[0] == row && at != rows[0].end()) return each[at - rows[0].begin()];
  }
  return "";
}

TEST(SceneTable, HasMeanAndSpreadOverSeedsAndScenes) {
  const std::vector<ScoredRun> runs = {
      MakeRun("fern", 1, 0.90, 0.95), MakeRun("fern", 2, 0.92, 0.95),
      MakeRun("room", 1, 0.80, 0.85), MakeRun("room", 2, 0.80, 0.85)};
  const std::vector<TableRow> rows = SceneTable(runs);
  EXPECT_EQ(CellOf(rows, "fern", "mIoU reference"), "91.0 +- 1.4");
  EXPECT_EQ(CellOf(rows, "room", "mIoU reference"), "80.0 +- 0.0");
  // The means of the seeds are 85 and 86.
  EXPECT_EQ(CellOf(rows, "mean of 2", "mIoU reference"), "85.5 +- 0.7");
  EXPECT_EQ(CellOf(rows, "mean of 2", "mIoU paper*"), "90.0 +- 0.0");
  EXPECT_EQ(CellOf(rows, "fern", "features min"), "2.0 +- 0.0");
  EXPECT_EQ(CellOf(rows, "fern", "all stages min"), "3.1 +- 0.0");
  EXPECT_THAT(rows[0], Not(::testing::Contains("LPIPS"))) << "nothing of it was measured";
}

TEST(SceneTable, LeavesSeedsThatAreNotOfAllScenesOutOfTheMean) {
  const std::vector<ScoredRun> runs = {MakeRun("fern", 1, 0.90, 0.95),
                                       MakeRun("fern", 2, 0.50, 0.95),
                                       MakeRun("room", 1, 0.80, 0.85)};
  EXPECT_EQ(CellOf(SceneTable(runs), "mean of 2", "mIoU reference"), "85.0");
}

TEST(SceneTable, HasARowForEachVariantAndLevel) {
  ScoredRun plain = MakeRun("desk", 1, 0.9, 0.9);
  plain.levels[0].name = "part";
  plain.levels.push_back(plain.levels[0]);
  plain.levels[1].name = "object";
  plain.levels[1].reference.known = false;
  ScoredRun varied = plain;
  varied.variant = "k = 8";
  const std::vector<TableRow> rows = SceneTable(std::vector<ScoredRun>{plain, varied});
  ASSERT_EQ(rows.size(), 7u);
  EXPECT_EQ(rows[1][0], "plain");
  EXPECT_EQ(rows[2][1], "desk object");
  EXPECT_EQ(rows[2][2], "-");
  EXPECT_EQ(rows[4][0], "k = 8");
}

TEST(PublishedTable, NeverPrintsANumberThatUsedTheScoredTruthInBold) {
  const std::vector<ScoredRun> runs = {MakeRun("fern", 1, 0.90, 0.97)};
  const std::vector<TableRow> rows = PublishedTable(Benchmark::kSpinNerf, runs);
  EXPECT_THAT(rows[1],
              ElementsAre("pepeseg (this run)", "the scored views*", "97.0", "99.0", "80.0"));
  EXPECT_THAT(rows[2], ElementsAre("PePESeg3D", "the scored views*", "92.3", "98.9", "-"));
  EXPECT_THAT(Markdown(rows), Not(HasSubstr("**")));
}

TEST(PublishedTable, PrintsTheBestInBoldIfItUsedNoScoredTruth) {
  const std::vector<ScoredRun> runs = {MakeRun("fern", 1, 0.93, 0.97)};
  EXPECT_THAT(Markdown(PublishedTable(Benchmark::kSpinNerf, runs)),
              HasSubstr("| pepeseg (this run) | the reference view | **93.0** | 98.0 | 70.0 |"));
  EXPECT_TRUE(PublishedTable(Benchmark::kScene, runs).empty());
}

TEST(PublishedTable, LeavesOutVariants) {
  ScoredRun run = MakeRun("fern", 1, 0.93, 0.97);
  run.variant = "k = 8";
  EXPECT_EQ(PublishedTable(Benchmark::kSpinNerf, std::vector<ScoredRun>{run}).size(), 6u);
}

TEST(PublishedCaveat, SaysThatTheTrueMaskIsAnEasierPromptThanText) {
  const std::vector<ScoredRun> runs = {MakeRun("figurines", 1, 0.80, 0.85)};
  const std::string caveat = PublishedCaveat(Benchmark::kLerfMask, runs);
  EXPECT_THAT(caveat, AllOf(HasSubstr("true mask of the first test view"),
                            HasSubstr("easier prompt than the text of the published rows")));
  EXPECT_THAT(ReportMarkdown(Benchmark::kLerfMask, runs), HasSubstr(caveat));
  for (const Benchmark masked :
       {Benchmark::kSpinNerf, Benchmark::kNvos, Benchmark::kLerfMaskFine, Benchmark::kScene}) {
    EXPECT_EQ(PublishedCaveat(masked, runs), "") << NameOf(masked);
    EXPECT_THAT(ReportMarkdown(masked, runs), Not(HasSubstr("easier")));
  }
}

TEST(PublishedCaveat, SaysThatTheTextIsThePrompt) {
  std::vector<ScoredRun> runs = {MakeRun("figurines", 1, 0.80, 0.85)};
  runs[0].protocol = kTextProtocol;
  EXPECT_THAT(PublishedCaveat(Benchmark::kLerfMask, runs),
              AllOf(HasSubstr("the name of the entity"), HasSubstr("counts as 0")));
}

TEST(CountMissing, CountsThemAsZero) {
  LevelScores scores;
  scores.num_entities = 1;
  scores.automatic = {true, 0.8, 0.9, 0.6};
  scores.entities = {{"mug", -1, -1, 0.8}};
  CountMissing({"red apple"}, scores);
  EXPECT_EQ(scores.num_entities, 2);
  EXPECT_EQ(scores.automatic.iou, 0.4);
  EXPECT_EQ(scores.automatic.accuracy, 0.45);
  EXPECT_EQ(scores.automatic.boundary_iou, 0.3);
  ASSERT_EQ(scores.entities.size(), 2u);
  EXPECT_EQ(scores.entities[1].name, "red apple");
  EXPECT_EQ(scores.entities[1].automatic, 0);
  LevelScores none;
  CountMissing({"a", "b"}, none);
  EXPECT_TRUE(none.automatic.known);
  EXPECT_EQ(none.automatic.iou, 0);
}

TEST(Csv, QuotesCellsWithCommasAndQuotes) {
  EXPECT_EQ(Csv({{"a", "b, c"}, {"\"d\"", ""}}), "a,\"b, c\"\n\"\"\"d\"\"\",\n");
}

TEST(RunRecord, ResumesWithTheRunsThatAreThere) {
  const pepeseg::testing::TempFolder folder;
  auto record = RunRecord::Open(folder / "record.jsonl");
  ASSERT_OK(record);
  ASSERT_OK(record->Add(MakeRun("fern", 1, 0.9, 0.95)));
  ASSERT_OK(record->Add(MakeRun("fern", 2, 0.8, 0.95)));
  // A crash has cut off the third line.
  std::ofstream(folder / "record.jsonl", std::ios::app) << R"({"scene": "ro)";
  const auto again = RunRecord::Open(folder / "record.jsonl");
  ASSERT_OK(again);
  ASSERT_EQ(again->runs().size(), 2u);
  EXPECT_EQ(again->runs()[1].levels[0].reference.iou, 0.8);
  EXPECT_EQ(again->runs()[1].seconds.at("features"), 120);
  EXPECT_TRUE(again->Has(MakeRun("fern", 2, 0, 0)));
  EXPECT_FALSE(again->Has(MakeRun("fern", 3, 0, 0)));
  ScoredRun other = MakeRun("fern", 2, 0, 0);
  other.options = "preset=preview";
  EXPECT_FALSE(again->Has(other));
}

TEST(RunRecord, KeepsTheIouOfEntities) {
  v1::EvaluateModelResponse response;
  auto& egg = *response.add_entities();
  egg.set_name("egg");
  egg.mutable_paper()->mutable_mean()->set_iou(0.75);
  egg.mutable_automatic()->mutable_mean()->set_iou(0.5);
  ScoredRun run = MakeRun("ramen", 1, 0.9, 0.95);
  run.levels = {ScoresOf("", response)};
  const pepeseg::testing::TempFolder folder;
  auto record = RunRecord::Open(folder / "record.jsonl");
  ASSERT_OK(record);
  ASSERT_OK(record->Add(run));
  const auto again = RunRecord::Open(folder / "record.jsonl");
  ASSERT_OK(again);
  ASSERT_EQ(again->runs()[0].levels[0].entities.size(), 1u);
  const EntityIou& kept = again->runs()[0].levels[0].entities[0];
  EXPECT_EQ(kept.name, "egg");
  EXPECT_EQ(kept.paper, 0.75);
  EXPECT_EQ(kept.automatic, 0.5);
  EXPECT_EQ(kept.reference, -1) << "the response has none";
}

TEST(RunRecord, ReadsRunsOfEarlierVersionsWithoutEntities) {
  const pepeseg::testing::TempFolder folder;
  std::ofstream(folder / "record.jsonl") << R"({"scene": "fern", "levels": [{"name": "part"}]})"
                                         << "\n";
  const auto record = RunRecord::Open(folder / "record.jsonl");
  ASSERT_OK(record);
  EXPECT_TRUE(record->runs()[0].levels[0].entities.empty());
}

TEST(RunRecord, RefusesAnotherFile) {
  const pepeseg::testing::TempFolder folder;
  std::ofstream(folder / "record.jsonl") << "{\"scene\": \"a\"}\nhello\n";
  EXPECT_THAT(RunRecord::Open(folder / "record.jsonl").status().ToString(), HasSubstr("line 2"));
}

TEST(RunRecord, WeightsTheAgreementWithSamByItsMasks) {
  ScoredRun run;
  v1::EvaluateModelResponse::SamAgreement agreement;
  agreement.set_num_masks(3);
  agreement.set_best_iou(0.9);
  AddSamAgreement(agreement, run);
  agreement.set_num_masks(1);
  agreement.set_best_iou(0.5);
  AddSamAgreement(agreement, run);
  EXPECT_EQ(run.sam_masks, 4);
  EXPECT_DOUBLE_EQ(run.sam_best_iou, 0.8);
}

TEST(BenchmarkVariants, AreTheRowsOfThePaper) { ASSERT_GE(AblationVariants().size(), 13u); }

}  // namespace
}  // namespace pepeseg::client::cli
