#include "clients/cli/demo_score.h"

#include <algorithm>
#include <chrono>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "clients/cli/evaluation.h"
#include "clients/cli/questions.h"
#include "clients/cpp/status_macros.h"

namespace pepeseg::client::cli {
namespace {

v1::EvaluateRequest EvaluateRequestOf(const std::string& model, const std::vector<DemoView>& views,
                                      std::span<const Product> products,
                                      const FixedQuestion& fixed) {
  v1::EvaluateRequest request;
  request.set_model(model);
  for (const DemoView& view : views) {
    auto& labels = *request.add_labels();
    labels.set_view(view.name);
    labels.set_png(EncodePng(view.labels));
    labels.set_ignore_png(EncodePng({view.labels.width, view.labels.height, view.ignore}));
  }
  for (const Product& product : products) {
    (*request.mutable_entity_names())[product.label] = product.name;
  }
  request.mutable_options()->add_fixed_scales(fixed.scale);
  request.mutable_options()->set_fixed_threshold(fixed.threshold);
  return request;
}

// The masks behind the scores at the fixed question, one a view of the entity.
absl::StatusOr<std::vector<Mask>> AskMasks(const Client& client, const std::string& model,
                                           const v1::EvaluateResponse::Entity& entity,
                                           const FixedQuestion& fixed) {
  v1::SegmentRequest request;
  request.set_model(model);
  request.mutable_prompt()->mutable_view()->set_view(entity.views(0).view());
  auto* point = request.mutable_prompt()->mutable_points()->add_points();
  point->set_x(entity.click_x());
  point->set_y(entity.click_y());
  request.mutable_granularity()->set_scale_quantile(fixed.scale);
  request.mutable_granularity()->set_threshold(fixed.threshold);
  for (const auto& view : entity.views()) request.mutable_targets()->add_views(view.view());
  request.set_mask_encoding(v1::MASK_ENCODING_COCO_RLE);
  ASSIGN_OR_RETURN(const v1::SegmentResponse answer, client.Segment(request));
  if (answer.masks_size() != entity.views_size()) return absl::InternalError("a mask is missing");
  std::vector<Mask> masks;
  for (const auto& view_mask : answer.masks()) {
    ASSIGN_OR_RETURN(Mask mask, DecodeRle(view_mask.rle()));
    masks.push_back(std::move(mask));
  }
  return masks;
}

// Pixels of a photograph.
size_t SizeOf(const std::vector<DemoView>& views, const std::string& name) {
  const auto found = std::find_if(views.begin(), views.end(),
                                  [&](const DemoView& view) { return view.name == name; });
  return found == views.end() ? 0 : found->labels.pixels.size();
}

absl::StatusOr<ProductScore> ScoreProduct(const Client& client, const std::string& model,
                                          const std::vector<DemoView>& views,
                                          const v1::EvaluateResponse::Entity& entity,
                                          const FixedQuestion& fixed) {
  ProductScore score;
  score.product = {entity.id(), entity.name()};
  score.scores = entity;
  std::vector<Mask> masks;
  if (entity.missing()) {  // there is nothing to ask
    for (const auto& view : entity.views()) masks.emplace_back(SizeOf(views, view.view()));
  } else {
    const auto start = std::chrono::steady_clock::now();
    ASSIGN_OR_RETURN(masks, AskMasks(client, model, entity, fixed));
    score.query_seconds =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  }
  for (int v = 0; v < entity.views_size(); ++v) {
    const std::string& name = entity.views(v).view();
    if (masks[v].size() != SizeOf(views, name)) {
      return absl::InternalError(absl::StrCat("the mask of ", name, " is not of its size"));
    }
    const double iou = entity.views(v).fixed_iou(0);
    score.mean_iou += iou / entity.views_size();
    score.views.push_back({name, v == 0, iou, std::move(masks[v])});
  }
  return score;
}

}  // namespace

absl::StatusOr<DemoScores> ScoreProducts(const Client& client, const std::string& model,
                                         const std::vector<DemoView>& views,
                                         std::span<const Product> products,
                                         const FixedQuestion& fixed) {
  DemoScores scores;
  ASSIGN_OR_RETURN(scores.evaluation,
                   client.Evaluate(EvaluateRequestOf(model, views, products, fixed)));
  for (const Product& product : products) {
    const auto& entities = scores.evaluation.entities();
    const auto entity = std::find_if(entities.begin(), entities.end(), [&](const auto& candidate) {
      return candidate.id() == product.label;
    });
    if (entity == entities.end()) {
      return absl::InvalidArgumentError(
          absl::StrCat("fewer than two held-out views show ", product.name));
    }
    ASSIGN_OR_RETURN(ProductScore score, ScoreProduct(client, model, views, *entity, fixed));
    scores.products.push_back(std::move(score));
  }
  return scores;
}

}  // namespace pepeseg::client::cli
