#include "server/api/evaluation.h"

#include <algorithm>
#include <set>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "server/api/error.h"
#include "server/api/request_image.h"

namespace pepeseg {
namespace {

// Maximum number of label images in a request.
constexpr int kMaxLabels = 1000;
// Of all views together. A pixel takes 2 bytes, or 3 if there is an image of ignored pixels.
constexpr int64_t kMaxLabelPixels = 64'000'000;

absl::StatusOr<ModelView> FindHeldOut(const std::string& name, const Model& model,
                                      const std::string& field) {
  const auto found = std::find_if(model.views.begin(), model.views.end(),
                                  [&](const ModelView& view) { return view.name == name; });
  if (found == model.views.end()) return BadField(field, name, "no view of the model");
  // A score on a training view would say nothing about the model.
  if (!found->held_out) return BadField(field, name, "not held out: the model was trained on it");
  return *found;
}

// Decodes the label image and the image of ignored pixels of one view.
absl::Status ReadImages(const v1::EvaluateModelRequest::ViewLabels& labels,
                        const ImageOfView& image, const std::string& field, LabeledView& labeled) {
  ASSIGN_OR_RETURN(FloatImage ids, DecodeGreyOf(image, labels.png(), field + ".png"));
  // Label ids are compared as whole numbers, so the frame takes them by the nearest pixel, without
  // blending two ids.
  const std::vector<float> in_view = image.frame.TakeToView(std::move(ids.values));
  labeled.labels.assign(in_view.begin(), in_view.end());
  if (labels.ignore_png().empty()) return absl::OkStatus();
  ASSIGN_OR_RETURN(const FloatImage grey,
                   DecodeGreyOf(image, labels.ignore_png(), field + ".ignore_png"));
  std::vector<uint8_t> ignore;
  ignore.reserve(grey.values.size());
  for (const float value : grey.values) ignore.push_back(value != 0 ? 1 : 0);
  labeled.ignore = image.frame.TakeIgnoreToView(ignore);
  return absl::OkStatus();
}

absl::StatusOr<LabeledView> ReadView(const v1::EvaluateModelRequest& request, int index,
                                     const Model& model, const std::string& field) {
  const v1::EvaluateModelRequest::ViewLabels& labels = request.labels(index);
  LabeledView labeled;
  ASSIGN_OR_RETURN(labeled.view, FindHeldOut(labels.view(), model, field + ".view"));
  RETURN_IF_ERROR(ReadImages(labels, ImageOf(labeled.view, request.frame()), field, labeled));
  return labeled;
}

// A repeated field has no presence: an empty one keeps the default.
void Overlay(const google::protobuf::RepeatedField<double>& values, std::vector<double>* option) {
  if (!values.empty()) option->assign(values.begin(), values.end());
}

v1::EvaluateModelResponse::Choice ChoiceToProto(const OneClickChoice& choice) {
  v1::EvaluateModelResponse::Choice proto;
  proto.set_scale_quantile(choice.scale);
  proto.set_threshold(choice.threshold);
  proto.set_iou(choice.iou);
  proto.set_boundary_iou(choice.boundary_iou);
  return proto;
}

// Returns the click of an entity, which is in the first of its views, in the pixels of `frame`.
Eigen::Vector2d ClickOf(const EntityScore& score, v1::PixelFrame frame, const Model& model) {
  const Eigen::Vector2d click(score.click.x, score.click.y);
  const auto view =
      std::find_if(model.views.begin(), model.views.end(), [&](const ModelView& candidate) {
        return !score.views.empty() && candidate.name == score.views.front().view;
      });
  // Without a view there is no frame to convert the click to.
  return view == model.views.end() ? click : ImageOf(*view, frame).frame.FromView(click);
}

void FillEntity(const EntityScore& score, v1::EvaluateModelResponse::Entity* entity) {
  entity->set_id(score.id);
  entity->set_missing(score.missing);
  *entity->mutable_chosen() = ChoiceToProto(score.chosen);
  *entity->mutable_oracle() = ChoiceToProto(score.oracle);
  entity->mutable_fixed_iou()->Assign(score.fixed_iou.begin(), score.fixed_iou.end());
  for (const EntityViewScore& view : score.views) {
    v1::EvaluateModelResponse::ViewScore& proto = *entity->add_views();
    proto.set_view(view.view);
    proto.set_num_pixels(view.num_pixels);
    proto.set_iou(view.iou);
    proto.set_boundary_iou(view.boundary_iou);
    proto.mutable_fixed_iou()->Assign(view.fixed_iou.begin(), view.fixed_iou.end());
  }
}

}  // namespace

absl::StatusOr<std::vector<LabeledView>> ReadLabels(const v1::EvaluateModelRequest& request,
                                                    const Model& model) {
  if (request.labels_size() < static_cast<int>(kMinViews) || request.labels_size() > kMaxLabels) {
    return BadField("labels", absl::StrCat(request.labels_size()),
                    absl::StrCat("views; allowed are ", kMinViews, "..", kMaxLabels));
  }
  std::vector<LabeledView> views;
  std::set<std::string> names;
  int64_t num_pixels = 0;
  RETURN_IF_ERROR(CheckFrame(request.frame()));
  for (int i = 0; i < request.labels_size(); ++i) {
    const v1::EvaluateModelRequest::ViewLabels& labels = request.labels(i);
    const std::string field = absl::StrCat("labels[", i, "]");
    // Two images of one view would count its pixels twice.
    if (!names.insert(labels.view()).second) {
      return BadField(field + ".view", labels.view(), "has labels already");
    }
    ASSIGN_OR_RETURN(LabeledView view, ReadView(request, i, model, field));
    num_pixels += static_cast<int64_t>(view.labels.size());
    if (num_pixels > kMaxLabelPixels) {
      return BadField(field, labels.view(),
                      absl::StrCat("over ", kMaxLabelPixels, " pixels with the views before it"));
    }
    views.push_back(std::move(view));
  }
  return views;
}

absl::StatusOr<OneClickOptions> OneClickOptionsFromProto(const v1::EvaluationOptions& proto) {
  OneClickOptions options;
  Overlay(proto.scales(), &options.scales);
  Overlay(proto.thresholds(), &options.thresholds);
  Overlay(proto.fixed_scales(), &options.fixed_scales);
  if (proto.has_fixed_threshold()) options.fixed_threshold = proto.fixed_threshold();
  if (proto.has_min_pixels()) options.min_pixels = proto.min_pixels();
  const absl::Status status = Validate(options);
  if (status.ok()) return options;
  // Validate's messages begin with the field's name, which is the same in the request.
  return absl::InvalidArgumentError(absl::StrCat("options.", std::string(status.message())));
}

v1::EvaluationOptions ToProto(const OneClickOptions& options) {
  v1::EvaluationOptions proto;
  proto.mutable_scales()->Assign(options.scales.begin(), options.scales.end());
  proto.mutable_thresholds()->Assign(options.thresholds.begin(), options.thresholds.end());
  proto.mutable_fixed_scales()->Assign(options.fixed_scales.begin(), options.fixed_scales.end());
  proto.set_fixed_threshold(options.fixed_threshold);
  proto.set_min_pixels(options.min_pixels);
  return proto;
}

void FillAnswer(const OneClickScores& scores, const v1::EvaluateModelRequest& request,
                const Model& model, v1::EvaluateModelResponse* response) {
  for (const EntityScore& score : scores.entities) {
    v1::EvaluateModelResponse::Entity* entity = response->add_entities();
    FillEntity(score, entity);
    const Eigen::Vector2d click = ClickOf(score, request.frame(), model);
    entity->set_click_x(click.x());
    entity->set_click_y(click.y());
    const auto name = request.entity_names().find(score.id);
    if (name != request.entity_names().end()) entity->set_name(name->second);
  }
  response->mutable_left_out()->Assign(scores.left_out.begin(), scores.left_out.end());
  *response->mutable_chosen() = ChoiceToProto(scores.chosen);
  *response->mutable_oracle() = ChoiceToProto(scores.oracle);
  response->mutable_fixed_iou()->Assign(scores.fixed_iou.begin(), scores.fixed_iou.end());
}

}  // namespace pepeseg
