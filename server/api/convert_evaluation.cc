#include "server/api/convert_evaluation.h"

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "server/api/error.h"
#include "server/api/request_image.h"

namespace pepeseg {
namespace {

using Response = v1::EvaluateModelResponse;

absl::StatusOr<Protocol> ProtocolFromProto(v1::EvaluationProtocol protocol) {
  switch (protocol) {
    case v1::EVALUATION_PROTOCOL_UNSPECIFIED:
    case v1::EVALUATION_PROTOCOL_PROMPT:
      return Protocol::kPrompt;
    case v1::EVALUATION_PROTOCOL_LABEL_PROPAGATION:
      return Protocol::kLabelPropagation;
    case v1::EVALUATION_PROTOCOL_LABEL_PROPAGATION_PIXELS:
      return Protocol::kLabelPropagationPixels;
    case v1::EVALUATION_PROTOCOL_PROMPTABLE:
      return Protocol::kPromptable;
    case v1::EVALUATION_PROTOCOL_CLICKS:
      return Protocol::kClicks;
    case v1::EVALUATION_PROTOCOL_SAM_AGREEMENT:
      return Protocol::kSamAgreement;
    default:
      return BadField("options.protocol", absl::StrCat(static_cast<int>(protocol)),
                      "not a protocol");
  }
}

v1::EvaluationProtocol ProtocolToProto(Protocol protocol) {
  switch (protocol) {
    case Protocol::kPrompt:
      break;
    case Protocol::kLabelPropagation:
      return v1::EVALUATION_PROTOCOL_LABEL_PROPAGATION;
    case Protocol::kLabelPropagationPixels:
      return v1::EVALUATION_PROTOCOL_LABEL_PROPAGATION_PIXELS;
    case Protocol::kPromptable:
      return v1::EVALUATION_PROTOCOL_PROMPTABLE;
    case Protocol::kClicks:
      return v1::EVALUATION_PROTOCOL_CLICKS;
    case Protocol::kSamAgreement:
      return v1::EVALUATION_PROTOCOL_SAM_AGREEMENT;
  }
  return v1::EVALUATION_PROTOCOL_PROMPT;
}

// A repeated field has no presence: an empty one keeps the default.
void OverlayValues(const google::protobuf::RepeatedField<double>& values,
                   std::vector<double>& option) {
  if (!values.empty()) option.assign(values.begin(), values.end());
}

void OverlayPropagation(const v1::EvaluationOptions::LabelPropagation& proto,
                        LabelPropagationOptions& options) {
  if (proto.has_min_cosine()) options.min_cosine = proto.min_cosine();
  if (proto.has_min_inside()) options.min_inside = proto.min_inside();
  if (proto.has_min_covered()) options.min_covered = proto.min_covered();
  if (proto.has_max_pixels()) options.max_pixels = proto.max_pixels();
}

void OverlaySam(const v1::EvaluationOptions::SamAgreement& proto, SamAgreementOptions& options) {
  if (proto.has_min_predicted_iou()) options.min_predicted_iou = proto.min_predicted_iou();
  if (proto.has_min_stability()) options.min_stability = proto.min_stability();
  if (proto.has_min_pixels()) options.min_pixels = proto.min_pixels();
  if (proto.has_num_proposals()) options.num_proposals = proto.num_proposals();
}

// Returns the error of core's Validate, whose message begins with the path of the option.
absl::Status NameOption(const absl::Status& status) {
  const std::string message = absl::StrCat("options.", status.message());
  return WithDetail(absl::InvalidArgumentError(message),
                    {.reason = "BAD_FIELD", .field = message.substr(0, message.find(' '))});
}

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

Response::Click ClickToProto(const PointPrompt& click, const Frame& frame) {
  const Eigen::Vector2d place = frame.FromView(Eigen::Vector2d(click.x, click.y));
  Response::Click proto;
  proto.set_x(place.x());
  proto.set_y(place.y());
  proto.set_negative(!click.positive);
  return proto;
}

void FillClicks(const EntityClicks& clicks, const Frame& frame, Response::Entity& entity) {
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

void FillEntity(const EntityScores& scores, const Frame& frame, Response::Entity& entity) {
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

absl::StatusOr<EvaluationOptions> EvaluationOptionsFromProto(const v1::EvaluationOptions& proto) {
  EvaluationOptions options;
  ASSIGN_OR_RETURN(options.protocol, ProtocolFromProto(proto.protocol()));
  OverlayValues(proto.scales(), options.scales);
  OverlayValues(proto.thresholds(), options.thresholds);
  if (proto.has_fixed_threshold()) options.fixed_threshold = proto.fixed_threshold();
  if (proto.has_min_pixels()) options.task.min_pixels = proto.min_pixels();
  options.task.score_reference = proto.score_reference();
  if (proto.has_refine_borders()) options.refine_borders = proto.refine_borders();
  OverlayPropagation(proto.label_propagation(), options.label_propagation);
  const v1::EvaluationOptions::Promptable& promptable = proto.promptable();
  if (promptable.has_min_cosine()) options.promptable.min_cosine = promptable.min_cosine();
  if (promptable.has_max_points()) options.promptable.max_points = promptable.max_points();
  if (proto.clicks().has_min_iou()) options.clicks.min_iou = proto.clicks().min_iou();
  if (proto.clicks().has_max_clicks()) options.clicks.max_clicks = proto.clicks().max_clicks();
  OverlaySam(proto.sam_agreement(), options.sam);
  const absl::Status status = Validate(options);
  if (!status.ok()) return NameOption(status);
  return options;
}

v1::EvaluationOptions ToProto(const EvaluationOptions& options, bool accept_trained_views) {
  v1::EvaluationOptions proto;
  proto.set_protocol(ProtocolToProto(options.protocol));
  proto.mutable_scales()->Assign(options.scales.begin(), options.scales.end());
  proto.mutable_thresholds()->Assign(options.thresholds.begin(), options.thresholds.end());
  proto.set_fixed_threshold(options.fixed_threshold);
  proto.set_min_pixels(options.task.min_pixels);
  proto.set_score_reference(options.task.score_reference);
  proto.set_refine_borders(options.refine_borders);
  proto.set_accept_trained_views(accept_trained_views);
  v1::EvaluationOptions::LabelPropagation& propagation = *proto.mutable_label_propagation();
  propagation.set_min_cosine(options.label_propagation.min_cosine);
  propagation.set_min_inside(options.label_propagation.min_inside);
  propagation.set_min_covered(options.label_propagation.min_covered);
  propagation.set_max_pixels(options.label_propagation.max_pixels);
  proto.mutable_promptable()->set_min_cosine(options.promptable.min_cosine);
  proto.mutable_promptable()->set_max_points(options.promptable.max_points);
  proto.mutable_clicks()->set_min_iou(options.clicks.min_iou);
  proto.mutable_clicks()->set_max_clicks(options.clicks.max_clicks);
  v1::EvaluationOptions::SamAgreement& sam = *proto.mutable_sam_agreement();
  sam.set_min_predicted_iou(options.sam.min_predicted_iou);
  sam.set_min_stability(options.sam.min_stability);
  sam.set_min_pixels(options.sam.min_pixels);
  sam.set_num_proposals(options.sam.num_proposals);
  return proto;
}

void FillEvaluation(const EvaluationResult& result, v1::PixelFrame frame, const Model& model,
                    v1::EvaluateModelResponse* response) {
  if (result.sam) return FillSam(*result.sam, *response->mutable_sam_agreement());
  bool with_clicks = false;
  for (const EntityScores& scores : result.entities) {
    const auto view = std::find_if(
        model.views.begin(), model.views.end(),
        [&](const ModelView& candidate) { return candidate.name == scores.reference; });
    FillEntity(scores, Frame(*view, FrameKindFromProto(frame)), *response->add_entities());
    with_clicks |= scores.clicks.has_value();
  }
  response->mutable_left_out()->Assign(result.left_out.begin(), result.left_out.end());
  for (const GroupScores& category : result.categories) {
    *response->add_categories() = GroupToProto(category, with_clicks);
  }
  *response->mutable_scene() = GroupToProto(result.scene, with_clicks);
  response->set_num_void_pixels(result.num_void);
}

}  // namespace pepeseg
