#include "server/api/evaluation_options.h"

#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "server/api/error.h"

namespace pepeseg {
namespace {

absl::StatusOr<Protocol> ProtocolFromProto(v1::EvaluationProtocol protocol) {
  switch (protocol) {
    case v1::EVALUATION_PROTOCOL_UNSPECIFIED:
    case v1::EVALUATION_PROTOCOL_PROMPT:
      return Protocol::kPrompt;
    case v1::EVALUATION_PROTOCOL_LABEL_PROPAGATION:
      return Protocol::kLabelPropagation;
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

}  // namespace

absl::StatusOr<EvaluationOptions> EvaluationOptionsFromProto(const v1::EvaluationOptions& proto) {
  EvaluationOptions options;
  ASSIGN_OR_RETURN(options.protocol, ProtocolFromProto(proto.protocol()));
  OverlayValues(proto.scales(), options.scales);
  OverlayValues(proto.thresholds(), options.thresholds);
  if (proto.has_fixed_threshold()) options.fixed_threshold = proto.fixed_threshold();
  if (proto.has_min_pixels()) options.task.min_pixels = proto.min_pixels();
  options.task.score_reference = proto.score_reference();
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

}  // namespace pepeseg
