#include "clients/benchmark/demo_score.h"

#include <algorithm>
#include <array>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "clients/cpp/status_macros.h"
#include "clients/terminal/flags.h"
#include "clients/terminal/progress_line.h"
#include "clients/terminal/view_picture.h"

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
    (*request.mutable_entity_names())[product.label] = product.id;
  }
  return request;
}

// Asks for the masks of one product as the app does.
class ProductAsker {
 public:
  ProductAsker(const Client& client, const std::string& model, const std::vector<DemoView>& views,
               ProductScore& score)
      : client_(client), model_(model), views_(views), score_(score) {}

  // Sets the answers of the score.
  absl::Status Ask() {
    if (score_.scores.missing()) {  // nothing is under the click: all masks are empty
      score_.automatic.views = score_.chosen.views = EmptyViews();
      return absl::OkStatus();
    }
    const Stopwatch watch;
    ASSIGN_OR_RETURN(const v1::ProposeScalesResponse answer, Propose());
    score_.num_proposals = answer.proposals_size();
    if (answer.proposals().empty()) {
      score_.automatic.views = score_.chosen.views = EmptyViews();
      return absl::OkStatus();
    }
    ASSIGN_OR_RETURN(score_.automatic, Segment(answer.proposals(answer.best())));
    score_.query_seconds = watch.Seconds();
    ASSIGN_OR_RETURN(const int chosen, BestInClickedView(answer));
    ASSIGN_OR_RETURN(score_.chosen, Segment(answer.proposals(chosen)));
    return absl::OkStatus();
  }

 private:
  v1::Prompt Click() const {
    v1::Prompt prompt;
    prompt.mutable_view()->set_view(score_.scores.reference_view());
    auto& point = *prompt.mutable_points()->add_points();
    point.set_x(score_.click.x());
    point.set_y(score_.click.y());
    return prompt;
  }

  absl::StatusOr<v1::ProposeScalesResponse> Propose() const {
    v1::ProposeScalesRequest request;
    request.set_model(model_);
    *request.mutable_prompt() = Click();
    request.set_max_proposals(kDemoProposals);
    request.set_mask_encoding(v1::MASK_ENCODING_COCO_RLE);
    return client_.ProposeScales(request);
  }

  // Returns the views that are scored, with empty masks.
  std::vector<ViewScore> EmptyViews() const {
    std::vector<ViewScore> scores;
    for (const DemoView& view : views_) {
      const bool clicked = view.name == score_.scores.reference_view();
      const auto& others = score_.scores.views();
      if (!clicked && std::none_of(others.begin(), others.end(),
                                   [&](const auto& other) { return other.view() == view.name; })) {
        continue;
      }
      scores.push_back({view.name, clicked, 0, view.labels.width, view.labels.height,
                        Mask(view.labels.pixels.size())});
    }
    return scores;
  }

  absl::StatusOr<double> Iou(const v1::CocoRle& rle, const DemoView& view, Mask& mask) const {
    ASSIGN_OR_RETURN(mask, DecodeRle(rle));
    if (mask.size() != view.labels.pixels.size()) {
      return absl::InternalError(absl::StrCat("the mask of ", view.name, " has ", mask.size(),
                                              " pixels, not ", view.labels.pixels.size()));
    }
    return IouOf(mask, view.TruthOf(score_.product.label), view.ignore);
  }

  const DemoView& Find(const std::string& name) const {
    return *std::find_if(views_.begin(), views_.end(),
                         [&](const DemoView& view) { return view.name == name; });
  }

  // Returns the proposal that a person would take who sees all of them in the clicked view.
  absl::StatusOr<int> BestInClickedView(const v1::ProposeScalesResponse& answer) const {
    int best = answer.best();
    double best_iou = -1;
    for (int i = 0; i < answer.proposals_size(); ++i) {
      Mask mask;
      ASSIGN_OR_RETURN(const double iou, Iou(answer.proposals(i).mask().rle(),
                                             Find(score_.scores.reference_view()), mask));
      if (iou > best_iou) best = i, best_iou = iou;
    }
    return best;
  }

  // Segments the proposal in all scored views.
  absl::StatusOr<DemoAnswer> Segment(const v1::ProposeScalesResponse::Proposal& proposal) const {
    DemoAnswer answer{WordOf(proposal.kind()), proposal.scale_quantile(), proposal.threshold(),
                      EmptyViews()};
    v1::SegmentViewsRequest request;
    request.set_model(model_);
    *request.mutable_prompt() = Click();
    request.mutable_granularity()->set_scale_quantile(answer.scale);
    request.mutable_granularity()->set_threshold(answer.threshold);
    for (const ViewScore& view : answer.views) request.mutable_targets()->add_views(view.view);
    request.set_mask_encoding(v1::MASK_ENCODING_COCO_RLE);
    ASSIGN_OR_RETURN(const v1::SegmentViewsResponse response, client_.Segment(request));
    if (response.masks_size() != static_cast<int>(answer.views.size())) {
      return absl::InternalError("the server's answer lacks a mask");
    }
    for (size_t v = 0; v < answer.views.size(); ++v) {
      ViewScore& view = answer.views[v];
      ASSIGN_OR_RETURN(view.iou,
                       Iou(response.masks(static_cast<int>(v)).rle(), Find(view.view), view.mask));
    }
    return answer;
  }

  const Client& client_;
  const std::string& model_;
  const std::vector<DemoView>& views_;
  ProductScore& score_;
};

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

double DemoAnswer::ClickedIou() const {
  for (const ViewScore& view : views) {
    if (view.clicked) return view.iou;
  }
  return 0;
}

double DemoAnswer::OtherIou() const {
  double sum = 0;
  int num_others = 0;
  for (const ViewScore& view : views) {
    if (view.clicked) continue;
    sum += view.iou;
    ++num_others;
  }
  return num_others == 0 ? 0 : sum / num_others;
}

double IouOf(const Mask& mask, const Mask& truth, const Mask& ignore) {
  int64_t both = 0, either = 0;
  for (size_t i = 0; i < mask.size(); ++i) {
    if (ignore[i] != 0) continue;
    both += mask[i] != 0 && truth[i] != 0 ? 1 : 0;
    either += mask[i] != 0 || truth[i] != 0 ? 1 : 0;
  }
  return either == 0 ? 1 : static_cast<double>(both) / static_cast<double>(either);
}

std::span<const Product> DemoProducts() {
  static const std::array<Product, 4> products = {
      {{48, "creativity_chenille_stems", "Creativity chenille stems"},
       {114, "i_am_a_bunny_book", "\"I Am a Bunny\" book"},
       {132, "kleenex_tissue_box", "Kleenex tissue box"},
       {144, "laugh_out_loud_joke_book", "\"Laugh-Out-Loud\" joke book"}}};
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
                                         std::span<const Product> products) {
  DemoScores scores;
  ASSIGN_OR_RETURN(scores.evaluation, client.Evaluate(ProductsRequest(model, views, products)));
  for (const Product& product : products) {
    ASSIGN_OR_RETURN(const Entity* entity, FindEntity(scores.evaluation, product.id));
    ProductScore score;
    score.product = product;
    score.scores = *entity;
    score.click = entity->clicks(0);
    RETURN_IF_ERROR(ProductAsker(client, model, views, score).Ask());
    scores.products.push_back(std::move(score));
  }
  return scores;
}

}  // namespace pepeseg::client::cli
