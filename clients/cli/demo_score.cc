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

using Entity = v1::EvaluateModelResponse::Entity;

// Returns a request that scores the products by one click each.
v1::EvaluateModelRequest ProductsRequest(const std::string& model,
                                         const std::vector<DemoView>& views,
                                         std::span<const Product> products) {
  v1::EvaluateModelRequest request;
  request.set_model(model);
  for (const DemoView& view : views) {
    v1::ViewTruth& truth = *request.add_views();
    truth.set_view(view.name);
    truth.set_labels_png(EncodePng(view.labels));
    truth.set_ignore_png(EncodePng({view.labels.width, view.labels.height, view.ignore}));
  }
  for (const Product& product : products) {
    (*request.mutable_entity_names())[product.label] = product.name;
  }
  return request;
}

// Restricts a request to the fixed granularity, and scores the clicked views, too.
v1::EvaluateModelRequest AtGranularity(v1::EvaluateModelRequest request,
                                       const FixedGranularity& fixed) {
  request.mutable_options()->add_scales(fixed.scale);
  request.mutable_options()->add_thresholds(fixed.threshold);
  request.mutable_options()->set_score_reference(true);
  return request;
}

// Segments the entity at the fixed granularity, and returns the mask of each of its views.
absl::StatusOr<std::vector<Mask>> SegmentViews(const Client& client, const std::string& model,
                                               const Entity& entity,
                                               const FixedGranularity& fixed) {
  v1::SegmentViewsRequest request;
  request.set_model(model);
  request.mutable_prompt()->mutable_view()->set_view(entity.reference_view());
  auto* point = request.mutable_prompt()->mutable_points()->add_points();
  point->set_x(entity.clicks(0).x());
  point->set_y(entity.clicks(0).y());
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

// Adds the masks and scores of one product at the fixed granularity. `entity` has those scores, of
// the clicked view, too.
absl::Status AddFixedScores(const Client& client, const std::string& model,
                            const std::vector<DemoView>& views, const Entity& entity,
                            const FixedGranularity& fixed, ProductScore& score) {
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
    const double iou = entity.paper().views(v).iou();  // of the only scale and threshold
    score.mean_iou += iou / entity.views_size();
    score.views.push_back({name, name == entity.reference_view(), iou, std::move(masks[v])});
  }
  return absl::OkStatus();
}

// Returns the scores of a product in a response. INVALID_ARGUMENT: it has none.
absl::StatusOr<const Entity*> FindEntity(const v1::EvaluateModelResponse& response,
                                         const std::string& name) {
  const auto& entities = response.entities();
  const auto found = std::find_if(entities.begin(), entities.end(),
                                  [&](const Entity& entity) { return entity.name() == name; });
  if (found != entities.end()) return &*found;
  return absl::InvalidArgumentError(absl::StrCat("fewer than two held-out views show ", name));
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
  const v1::EvaluateModelRequest request = ProductsRequest(model, views, products);
  ASSIGN_OR_RETURN(scores.evaluation, client.Evaluate(request));
  ASSIGN_OR_RETURN(const v1::EvaluateModelResponse at_fixed,
                   client.Evaluate(AtGranularity(request, fixed)));
  for (const Product& product : products) {
    ASSIGN_OR_RETURN(const Entity* entity, FindEntity(scores.evaluation, product.name));
    ASSIGN_OR_RETURN(const Entity* fixed_entity, FindEntity(at_fixed, product.name));
    ProductScore score;
    score.product = product;
    score.scores = *entity;
    score.click = entity->clicks(0);
    RETURN_IF_ERROR(AddFixedScores(client, model, views, *fixed_entity, fixed, score));
    scores.products.push_back(std::move(score));
  }
  return scores;
}

}  // namespace pepeseg::client::cli
