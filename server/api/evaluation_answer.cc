#include "server/api/evaluation_answer.h"

#include <algorithm>

#include "server/api/request_image.h"

namespace pepeseg {
namespace {

using Response = v1::EvaluateModelResponse;

Response::Scores ScoresToProto(const MaskScores& scores) {
  Response::Scores proto;
  proto.set_iou(scores.iou);
  proto.set_accuracy(scores.accuracy);
  proto.set_boundary_iou(scores.boundary_iou);
  return proto;
}

Response::Choice ChoiceToProto(const ChoiceScores& choice) {
  Response::Choice proto;
  proto.set_scale_quantile(choice.scale);
  proto.set_threshold(choice.threshold);
  *proto.mutable_mean() = ScoresToProto(choice.mean);
  for (const MaskScores& scores : choice.views) *proto.add_views() = ScoresToProto(scores);
  return proto;
}

Response::Click ClickToProto(const PointPrompt& click, const PhotographFrame& frame) {
  const Eigen::Vector2d place = frame.FromView({click.x, click.y});
  Response::Click proto;
  proto.set_x(place.x());
  proto.set_y(place.y());
  proto.set_negative(!click.positive);
  return proto;
}

void FillClicks(const EntityClicks& clicks, const PhotographFrame& frame,
                Response::Entity& entity) {
  entity.set_reached(clicks.reached);
  entity.set_num_clicks(clicks.num_clicks);
  for (const ClickAnswer& answer : clicks.answers) {
    Response::Click& proto = *entity.add_clicks();
    proto = ClickToProto(answer.click, frame);
    proto.set_reference_iou(answer.reference_iou);
    proto.set_iou(answer.iou);
  }
}

void FillChoices(const EntityScores& scores, Response::Entity& entity) {
  *entity.mutable_paper() = ChoiceToProto(scores.paper);
  if (scores.reference_choice) {
    *entity.mutable_reference() = ChoiceToProto(*scores.reference_choice);
  }
  *entity.mutable_automatic() = ChoiceToProto(scores.automatic);
  entity.mutable_iou_by_scale()->Assign(scores.iou_by_scale.begin(), scores.iou_by_scale.end());
}

void FillEntity(const EntityScores& scores, const PhotographFrame& frame,
                Response::Entity& entity) {
  entity.set_name(scores.name);
  entity.set_category(scores.category);
  entity.set_reference_view(scores.reference);
  for (size_t v = 0; v < scores.scored.size(); ++v) {
    Response::ScoredView& view = *entity.add_views();
    view.set_view(scores.scored[v]);
    view.set_num_pixels(scores.num_pixels[v]);
  }
  entity.set_missing(scores.missing);
  if (scores.clicks) return FillClicks(*scores.clicks, frame, entity);
  if (scores.click) *entity.add_clicks() = ClickToProto(*scores.click, frame);
  FillChoices(scores, entity);
}

// `with_clicks`: the protocol counts clicks and chooses nothing.
Response::GroupScores GroupToProto(const GroupScores& group, bool with_clicks) {
  Response::GroupScores proto;
  proto.set_name(group.name);
  proto.set_num_entities(group.num_entities);
  if (with_clicks) {
    proto.set_num_clicks(group.num_clicks);
    proto.set_reached(group.reached);
    proto.mutable_iou_after()->Assign(group.iou_after.begin(), group.iou_after.end());
    return proto;
  }
  *proto.mutable_paper() = ScoresToProto(group.paper);
  if (group.reference_choice) *proto.mutable_reference() = ScoresToProto(*group.reference_choice);
  *proto.mutable_automatic() = ScoresToProto(group.automatic);
  proto.mutable_iou_by_scale()->Assign(group.iou_by_scale.begin(), group.iou_by_scale.end());
  return proto;
}

void FillSam(const SamAgreement& sam, Response::SamAgreement& proto) {
  for (const SamViewScores& scores : sam.views) {
    Response::SamView& view = *proto.add_views();
    view.set_view(scores.view);
    view.set_num_masks(static_cast<int64_t>(scores.masks.size()));
    view.set_first_iou(scores.first_iou);
    view.set_best_iou(scores.best_iou);
  }
  proto.set_num_masks(sam.num_masks);
  proto.set_first_iou(sam.first_iou);
  proto.set_best_iou(sam.best_iou);
}

}  // namespace

void FillEvaluation(const EvaluationResult& result, v1::PixelFrame frame, const Model& model,
                    v1::EvaluateModelResponse* response) {
  if (result.sam) return FillSam(*result.sam, *response->mutable_sam_agreement());
  bool with_clicks = false;
  for (const EntityScores& scores : result.entities) {
    const auto view = std::find_if(
        model.views.begin(), model.views.end(),
        [&](const ModelView& candidate) { return candidate.name == scores.reference; });
    FillEntity(scores, ImageOf(*view, frame).frame, *response->add_entities());
    with_clicks |= scores.clicks.has_value();
  }
  response->mutable_left_out()->Assign(result.left_out.begin(), result.left_out.end());
  for (const GroupScores& category : result.categories) {
    *response->add_categories() = GroupToProto(category, with_clicks);
  }
  *response->mutable_scene() = GroupToProto(result.scene, with_clicks);
}

}  // namespace pepeseg
