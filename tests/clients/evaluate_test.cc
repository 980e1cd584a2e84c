#include "clients/cli/evaluate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace pepeseg::client::cli {
namespace {

using ::testing::ElementsAre;

void SetChoice(double scale, double threshold, double iou, double boundary_iou,
               v1::EvaluateModelResponse::Choice* choice) {
  choice->set_scale_quantile(scale);
  choice->set_threshold(threshold);
  choice->set_iou(iou);
  choice->set_boundary_iou(boundary_iou);
}

v1::EvaluateModelResponse TwoEntities() {
  v1::EvaluateModelResponse answer;
  auto* entity = answer.add_entities();
  entity->set_id(48);
  entity->set_name("chenille stems");
  for (int v = 0; v < 2; ++v) entity->add_views();
  SetChoice(0.3, 0.75, 0.765, 0.603, entity->mutable_chosen());
  SetChoice(0.4, 0.8, 0.771, 0.61, entity->mutable_oracle());
  entity = answer.add_entities();
  entity->set_id(144);
  for (int v = 0; v < 4; ++v) entity->add_views();
  entity->set_missing(true);
  SetChoice(0, 0, 0.3826, 0.3012, answer.mutable_chosen());
  SetChoice(0, 0, 0.3854, 0.305, answer.mutable_oracle());
  answer.mutable_options()->set_fixed_threshold(0.75);
  for (const double scale : {0.01, 0.1, 1.0}) {
    answer.mutable_options()->add_fixed_scales(scale);
    answer.add_fixed_iou(0.25 + scale / 10);
  }
  return answer;
}

TEST(EvaluationTable, ShowsEntitiesMeansAndFixedScales) {
  EXPECT_THAT(EvaluationTable(TwoEntities()),
              ElementsAre("entity             views    IoU   BIoU  scale  threshold  oracle",
                          "48 chenille stems      1  0.765  0.603   0.30       0.75   0.771",
                          "144                    3  0.000  0.000      -          -   0.000"
                          "  nothing under the click",
                          "mean of 2                 0.383  0.301                     0.385", "",
                          "fixed scale, threshold 0.75   0.01    0.1      1",
                          "mean IoU                     0.251  0.260  0.350"));
}

TEST(EvaluationTable, NamesEntitiesThatAreLeftOut) {
  v1::EvaluateModelResponse answer = TwoEntities();
  answer.add_left_out(7);
  answer.add_left_out(300);
  EXPECT_THAT(EvaluationTable(answer),
              ::testing::Contains("left out, in fewer than two held-out views: 7, 300"));
}

}  // namespace
}  // namespace pepeseg::client::cli
