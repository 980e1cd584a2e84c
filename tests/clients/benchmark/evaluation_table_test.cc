#include "clients/benchmark/evaluation_table.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

namespace pepeseg::client::cli {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;
using Response = v1::EvaluateModelResponse;

void Set(double iou, double accuracy, double boundary_iou, Response::Scores* scores) {
  scores->set_iou(iou);
  scores->set_accuracy(accuracy);
  scores->set_boundary_iou(boundary_iou);
}

Response TwoEntities() {
  Response response;
  response.set_model("scenes/s/models/1");
  auto* entity = response.add_entities();
  entity->set_name("mug.1");
  entity->add_views();
  entity->mutable_reference()->set_scale_quantile(0.3);
  entity->mutable_reference()->set_threshold(0.75);
  Set(0.765, 0.98, 0.603, entity->mutable_reference()->mutable_mean());
  Set(0.7, 0.97, 0.6, entity->mutable_automatic()->mutable_mean());
  Set(0.771, 0.99, 0.61, entity->mutable_paper()->mutable_mean());
  entity = response.add_entities();
  entity->set_name("mug.2");
  for (int v = 0; v < 3; ++v) entity->add_views();
  entity->set_missing(true);
  entity->mutable_paper();
  auto* category = response.add_categories();
  category->set_name("mug");
  category->set_num_entities(2);
  *response.mutable_scene() = *category;
  for (auto* group : {category, response.mutable_scene()}) {
    Set(0.382, 0.49, 0.301, group->mutable_reference());
    Set(0.35, 0.485, 0.3, group->mutable_automatic());
    Set(0.386, 0.495, 0.305, group->mutable_paper());
  }
  for (const double scale : {0.01, 1.0}) {
    response.mutable_options()->add_scales(scale);
    response.mutable_scene()->add_iou_by_scale(0.25 + scale / 10);
  }
  return response;
}

TEST(EvaluationTable, SeparatesNumbersThatUsedTheScoredTruth) {
  EXPECT_THAT(
      EvaluationTable(TwoEntities()),
      ElementsAre(
          "entity     views  reference IoU  Acc    BIoU   scale  threshold  automatic IoU  Acc    "
          "BIoU   paper* IoU  Acc*   BIoU*",
          "mug.1      1      0.765          0.980  0.603  0.30   0.75       0.700          0.970  "
          "0.600  0.771       0.990  0.610",
          "mug.2      3      -              -      -      -      -          0.000          0.000  "
          "0.000  0.000       0.000  0.000  nothing under the prompt",
          "mug (2)           0.382          0.490  0.301                    0.350          0.485  "
          "0.300  0.386       0.495  0.305",
          "mean of 2         0.382          0.490  0.301                    0.350          0.485  "
          "0.300  0.386       0.495  0.305",
          "* scale and threshold chosen by the scored truth, as papers publish: an upper bound", "",
          "one scale for all  0.01   1", "mean IoU           0.251  0.350"));
}

TEST(EvaluationTable, NamesEntitiesThatAreLeftOut) {
  Response response = TwoEntities();
  response.add_left_out("cup");
  response.add_left_out("7");
  EXPECT_THAT(EvaluationTable(response), Contains("left out, without a view to score: cup, 7"));
}

TEST(EvaluationTable, SaysHowManyVoidPixelsWereLeftOut) {
  Response response = TwoEntities();
  EXPECT_THAT(EvaluationTable(response), Not(Contains(HasSubstr("void"))));
  response.set_num_void_pixels(1234);
  EXPECT_THAT(EvaluationTable(response),
              Contains("1234 void pixels of the label images were left out of all scores"));
}

TEST(EvaluationTable, ShowsNotes) {
  Response response = TwoEntities();
  response.add_notes("the truth of 2 views is turned");
  EXPECT_THAT(EvaluationTable(response), Contains("the truth of 2 views is turned"));
  Response sam;
  sam.mutable_sam_agreement();
  sam.add_notes("the truth of 3 views is turned");
  EXPECT_THAT(EvaluationTable(sam), Contains("the truth of 3 views is turned"));
}

TEST(EvaluationTable, ShowsClicks) {
  Response response;
  response.mutable_options()->set_protocol(v1::EVALUATION_PROTOCOL_CLICKS);
  auto* entity = response.add_entities();
  entity->set_name("mug");
  entity->add_views();
  entity->set_num_clicks(2);
  entity->set_reached(true);
  entity->add_clicks()->set_iou(0.5);
  entity->add_clicks()->set_iou(0.75);
  response.mutable_scene()->set_num_clicks(2);
  response.mutable_scene()->set_reached(1);
  for (const double iou : {0.5, 0.75, 0.75}) response.mutable_scene()->add_iou_after(iou);
  EXPECT_THAT(EvaluationTable(response),
              ElementsAre("entity     views  clicks  reached  IoU after 1  after 2  after 3",
                          "mug        1      2       yes      0.500        0.750    0.750",
                          "mean of 1         2.00    100%     0.500        0.750    0.750"));
}

TEST(EvaluationTable, ShowsTheAgreementWithSam) {
  Response response;
  response.mutable_options()->mutable_sam_agreement()->set_num_proposals(3);
  Response::SamAgreement& sam = *response.mutable_sam_agreement();
  auto* view = sam.add_views();
  view->set_view("a.jpg");
  view->set_num_masks(12);
  view->set_first_iou(0.5);
  view->set_best_iou(0.75);
  sam.set_num_masks(12);
  sam.set_first_iou(0.5);
  sam.set_best_iou(0.75);
  EXPECT_THAT(
      EvaluationTable(response),
      ElementsAre("view       masks  first IoU  best* IoU", "a.jpg      12     0.500      0.750",
                  "all masks  12     0.500      0.750",
                  "* the best of 3 proposals, chosen by the mask that it is scored with"));
}

TEST(SpreadOf, MatchesHandComputedNumbers) {
  const Spread spread = SpreadOf({0.5, 0.75, 1.0});
  EXPECT_EQ(spread.count, 3);
  EXPECT_DOUBLE_EQ(spread.mean, 0.75);
  EXPECT_DOUBLE_EQ(spread.deviation, 0.25);
  EXPECT_DOUBLE_EQ(spread.least, 0.5);
  EXPECT_DOUBLE_EQ(spread.most, 1.0);
  const Spread four = SpreadOf({2, 4, 4, 6});
  EXPECT_EQ(four.count, 4);
  EXPECT_DOUBLE_EQ(four.mean, 4);
  EXPECT_DOUBLE_EQ(four.deviation, std::sqrt(8.0 / 3));
  EXPECT_EQ(four.least, 2);
  EXPECT_EQ(four.most, 6);
  const Spread one = SpreadOf({3});
  EXPECT_EQ(one.count, 1);
  EXPECT_EQ(one.mean, 3);
  EXPECT_EQ(one.deviation, 0);
  EXPECT_EQ(SpreadOf({0.5}).deviation, 0);
  EXPECT_EQ(SpreadOf({}).count, 0);
}

TEST(SpreadTable, HasAModelALineAndTheSpread) {
  Response other = TwoEntities();
  other.set_model("scenes/s/models/2");
  other.mutable_scene()->clear_reference();
  other.mutable_scene()->mutable_paper()->set_iou(0.586);
  const Response responses[] = {TwoEntities(), other};
  const std::vector<std::string> lines = SpreadTable(responses);
  ASSERT_EQ(lines.size(), 8u);
  EXPECT_TRUE(lines[0].starts_with("model               reference iou  reference accuracy"));
  EXPECT_NE(lines[0].find("paper iou*"), std::string::npos);
  EXPECT_TRUE(lines[1].starts_with("scenes/s/models/1   0.382 "));
  EXPECT_TRUE(lines[2].starts_with("scenes/s/models/2   - "));
  EXPECT_TRUE(lines[3].starts_with("mean                0.382 "));
  EXPECT_EQ(lines[7], "* chosen by the scored truth: an upper bound");
  const auto json = SpreadJson(responses);
  EXPECT_EQ(json["evaluations"].size(), 2u);
  EXPECT_EQ(json["evaluations"][1]["model"], "scenes/s/models/2");
  const auto& paper = json["spread"]["paper_iou"];
  EXPECT_NEAR(paper["mean"].get<double>(), 0.486, 1e-12);
  EXPECT_NEAR(paper["deviation"].get<double>(), 0.2 / std::sqrt(2.0), 1e-12);
  EXPECT_EQ(paper["uses_scored_truth"], true);
  EXPECT_EQ(json["spread"]["automatic_iou"]["uses_scored_truth"], false);
  EXPECT_EQ(json["spread"]["reference_iou"]["count"], 1);
}

}  // namespace
}  // namespace pepeseg::client::cli
