#include "clients/cli/demo_score.h"

#include <algorithm>
#include <array>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "clients/cli/progress_line.h"
#include "clients/cli/view_picture.h"
#include "clients/cpp/status_macros.h"

namespace pepeseg::client::cli {
namespace {

namespace fs = std::filesystem;

// Reads the photograph and the ground truth of a view.
absl::StatusOr<DemoView> ReadView(const fs::path& data, const v1::View& view) {
  const auto [width, height] = PhotographSize(view);
  DemoView result;
  result.name = view.view();
  ASSIGN_OR_RETURN(const Picture photo, ReadPicture(data / "images" / view.view()));
  result.photo = Resized(photo, width, height);
  const fs::path label_file = fs::path(view.view()).replace_extension(".png");
  ASSIGN_OR_RETURN(const GreyPicture labels, ReadGreyPicture(data / "labels" / label_file));
  result.labels = Resized(labels, width, height);
  ASSIGN_OR_RETURN(const GreyPicture ignore, ReadGreyPicture(data / "ignore_mask.png"));
  result.ignore = Resized(ignore, width, height).pixels;
  return result;
}

// Returns a request that scores the products by one click each, and at the fixed granularity.
v1::EvaluateModelRequest ProductsRequest(const std::string& model,
                                         const std::vector<DemoView>& views,
                                         std::span<const Product> products,
                                         const FixedGranularity& fixed) {
  v1::EvaluateModelRequest request;
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

// Segments the entity at the fixed granularity, and returns the mask of each of its views.
absl::StatusOr<std::vector<Mask>> SegmentViews(const Client& client, const std::string& model,
                                               const v1::EvaluateModelResponse::Entity& entity,
                                               const FixedGranularity& fixed) {
  v1::SegmentViewsRequest request;
  request.set_model(model);
  request.mutable_prompt()->mutable_view()->set_view(entity.views(0).view());
  auto* point = request.mutable_prompt()->mutable_points()->add_points();
  point->set_x(entity.click_x());
  point->set_y(entity.click_y());
  request.mutable_granularity()->set_scale_quantile(fixed.scale);
  request.mutable_granularity()->set_threshold(fixed.threshold);
  for (const auto& view : entity.views()) request.mutable_targets()->add_views(view.view());
  request.set_mask_encoding(v1::MASK_ENCODING_COCO_RLE);
  ASSIGN_OR_RETURN(const v1::SegmentViewsResponse answer, client.Segment(request));
  if (answer.masks_size() != entity.views_size())
    return absl::InternalError("the server's answer lacks a mask");
  std::vector<Mask> masks;
  for (const auto& view_mask : answer.masks()) {
    ASSIGN_OR_RETURN(Mask mask, DecodeRle(view_mask.rle()));
    masks.push_back(std::move(mask));
  }
  return masks;
}

// Returns the number of pixels of a view.
size_t SizeOf(const std::vector<DemoView>& views, const std::string& name) {
  const auto found = std::find_if(views.begin(), views.end(),
                                  [&](const DemoView& view) { return view.name == name; });
  return found == views.end() ? 0 : found->labels.pixels.size();
}

// Returns the scores of one product, with its masks at the fixed granularity. `entity` has the
// scores by the protocol; its first view is the clicked one.
absl::StatusOr<ProductScore> ScoreProduct(const Client& client, const std::string& model,
                                          const std::vector<DemoView>& views,
                                          const v1::EvaluateModelResponse::Entity& entity,
                                          const FixedGranularity& fixed) {
  ProductScore score;
  score.product = {entity.id(), entity.name()};
  score.scores = entity;
  std::vector<Mask> masks;
  if (entity.missing()) {  // nothing is under the click: the masks are empty
    for (const auto& view : entity.views()) masks.emplace_back(SizeOf(views, view.view()));
  } else {
    const Stopwatch watch;
    ASSIGN_OR_RETURN(masks, SegmentViews(client, model, entity, fixed));
    score.query_seconds = watch.Seconds();
  }
  for (int v = 0; v < entity.views_size(); ++v) {
    const std::string& name = entity.views(v).view();
    if (masks[v].size() != SizeOf(views, name)) {
      return absl::InternalError(absl::StrCat("the mask of ", name, " has ", masks[v].size(),
                                              " pixels, not ", SizeOf(views, name)));
    }
    const double iou = entity.views(v).fixed_iou(0);
    score.mean_iou += iou / entity.views_size();
    score.views.push_back({name, v == 0, iou, std::move(masks[v])});
  }
  return score;
}

}  // namespace

Mask DemoView::TruthOf(int label) const {
  Mask mask;
  mask.reserve(labels.pixels.size());
  for (const uint8_t value : labels.pixels) mask.push_back(value == label ? 1 : 0);
  return mask;
}

std::span<const Product> DemoProducts() {
  static const std::array<Product, 4> products = {{{48, "creativity_chenille_stems"},
                                                   {114, "i_am_a_bunny_book"},
                                                   {132, "kleenex_tissue_box"},
                                                   {144, "laugh_out_loud_joke_book"}}};
  return products;
}

absl::StatusOr<std::vector<DemoView>> ReadHeldOut(const fs::path& data,
                                                  const std::vector<v1::View>& views) {
  std::vector<DemoView> held_out;
  for (const v1::View& view : views) {
    if (!view.held_out()) continue;
    ASSIGN_OR_RETURN(DemoView read, ReadView(data, view));
    held_out.push_back(std::move(read));
  }
  if (held_out.empty()) {
    return absl::InvalidArgumentError("the model has no held-out view to score");
  }
  return held_out;
}

absl::StatusOr<DemoScores> ScoreProducts(const Client& client, const std::string& model,
                                         const std::vector<DemoView>& views,
                                         std::span<const Product> products,
                                         const FixedGranularity& fixed) {
  DemoScores scores;
  ASSIGN_OR_RETURN(scores.evaluation,
                   client.Evaluate(ProductsRequest(model, views, products, fixed)));
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
