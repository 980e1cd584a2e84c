#include "clients/cli/demo_score.h"

#include <algorithm>
#include <chrono>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "clients/cli/questions.h"
#include "clients/cli/status_macros.h"

namespace pepeseg::cli {
namespace {

constexpr int64_t kMinArea = 100;  // pixels, for a view to show a product
constexpr double kCosineUnit = 1.0 / 32767;

// The grids of the protocol: 0.01 and 0.1 to 1; 0.5 to 0.95.
std::vector<double> Scales() {
  std::vector<double> scales = {0.01};
  for (int i = 1; i <= 10; ++i) scales.push_back(0.1 * i);
  return scales;
}
std::vector<double> Thresholds() {
  std::vector<double> thresholds;
  for (int i = 10; i <= 19; ++i) thresholds.push_back(0.05 * i);
  return thresholds;
}

v1::SegmentRequest BuildRequest(const Question& question, const std::vector<std::string>& targets) {
  v1::SegmentRequest request;
  request.set_model(question.model);
  request.mutable_prompt_view()->set_view(question.view);
  auto* point = request.mutable_points()->add_points();
  point->set_x(question.click.x + 0.5);
  point->set_y(question.click.y + 0.5);
  request.set_scale_quantile(question.scale);
  request.set_threshold(question.threshold);
  for (const std::string& view : targets) request.mutable_targets()->add_views(view);
  request.set_mask_encoding(v1::MASK_ENCODING_COCO_RLE);
  return request;
}

// One mask a target, in their order.
absl::StatusOr<std::vector<Mask>> Ask(const Connection& connection, const Question& question,
                                      const std::vector<const DemoView*>& targets) {
  std::vector<std::string> names;
  for (const DemoView* view : targets) names.push_back(view->name);
  ASSIGN_OR_RETURN(const v1::SegmentResponse answer,
                   AskSegment(connection, BuildRequest(question, names)));
  std::vector<Mask> masks;
  for (const auto& view_mask : answer.masks()) {
    ASSIGN_OR_RETURN(Mask mask, DecodeRle(view_mask.rle()));
    const size_t at = masks.size();
    if (at >= targets.size() || view_mask.view() != names[at] ||
        mask.size() != targets[at]->ignore.size()) {
      return absl::InternalError(absl::StrCat("unexpected mask of ", view_mask.view()));
    }
    masks.push_back(std::move(mask));
  }
  if (masks.size() != targets.size()) return absl::InternalError("a mask is missing");
  return masks;
}

int16_t Int16At(const std::string& bytes, size_t i) {
  const auto low = static_cast<uint8_t>(bytes[2 * i]);
  const auto high = static_cast<uint8_t>(bytes[2 * i + 1]);
  return static_cast<int16_t>(static_cast<uint16_t>(low | (high << 8)));
}

struct Choice {
  double scale = 0;
  double threshold = 0;
  double iou = -1;
};

// The best threshold of one scale, from the similarity map: one question instead of ten.
absl::StatusOr<Choice> ChooseThreshold(const Connection& connection, const Question& question,
                                       const DemoView& view, const Mask& truth) {
  v1::SegmentRequest request = BuildRequest(question, {view.name});
  request.set_want_similarity(true);
  ASSIGN_OR_RETURN(const v1::SegmentResponse answer, AskSegment(connection, request));
  if (answer.masks_size() != 1 ||
      answer.masks(0).similarity().values().size() != 2 * truth.size()) {
    return absl::InternalError(absl::StrCat("no similarity map of ", view.name));
  }
  const std::string& similarity = answer.masks(0).similarity().values();
  Choice best;
  Mask mask(truth.size());
  for (const double threshold : Thresholds()) {
    for (size_t i = 0; i < mask.size(); ++i) {
      mask[i] = Int16At(similarity, i) * kCosineUnit > threshold ? 1 : 0;
    }
    const double iou = Iou(mask, truth, view.ignore);
    if (iou > best.iou) best = {question.scale, threshold, iou};
  }
  return best;
}

// Scale and threshold from the first view, scored on the others.
absl::Status ScoreChosen(const Connection& connection, const std::string& model,
                         const std::vector<const DemoView*>& views, ProductScore& score) {
  Question question{model, views[0]->name, score.click, 0, 0};
  const Mask truth = views[0]->TruthOf(score.product.label);
  Choice best;
  for (const double scale : Scales()) {
    question.scale = scale;
    ASSIGN_OR_RETURN(const Choice choice, ChooseThreshold(connection, question, *views[0], truth));
    if (choice.iou > best.iou) best = choice;
  }
  score.chosen_scale = question.scale = best.scale;
  score.chosen_threshold = question.threshold = best.threshold;
  const std::vector<const DemoView*> others(views.begin() + 1, views.end());
  if (others.empty()) return absl::OkStatus();
  ASSIGN_OR_RETURN(const std::vector<Mask> masks, Ask(connection, question, others));
  for (size_t i = 0; i < others.size(); ++i) {
    const Mask other_truth = others[i]->TruthOf(score.product.label);
    score.chosen_iou +=
        Iou(masks[i], other_truth, others[i]->ignore) / static_cast<double>(others.size());
  }
  return absl::OkStatus();
}

Pixel Click(const DemoView& view, int label) {
  Mask clickable = view.TruthOf(label);
  for (size_t i = 0; i < clickable.size(); ++i) clickable[i] &= view.ignore[i] == 0 ? 1 : 0;
  return DeepestPixel(clickable, view.labels.width, view.labels.height);
}

}  // namespace

absl::StatusOr<ProductScore> ScoreProduct(const Connection& connection, const std::string& model,
                                          const std::vector<DemoView>& views,
                                          const Product& product, const FixedQuestion& fixed) {
  std::vector<const DemoView*> showing;
  for (const DemoView& view : views) {
    if (Area(view.TruthOf(product.label), view.ignore) >= kMinArea) showing.push_back(&view);
  }
  if (showing.empty()) {
    return absl::InvalidArgumentError(absl::StrCat("no held-out view shows ", product.name));
  }
  ProductScore score;
  score.product = product;
  score.click = Click(*showing[0], product.label);
  const Question question{model, showing[0]->name, score.click, fixed.scale, fixed.threshold};
  const auto start = std::chrono::steady_clock::now();
  ASSIGN_OR_RETURN(std::vector<Mask> masks, Ask(connection, question, showing));
  score.query_seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  for (size_t i = 0; i < showing.size(); ++i) {
    const double iou = Iou(masks[i], showing[i]->TruthOf(product.label), showing[i]->ignore);
    score.mean_iou += iou / static_cast<double>(showing.size());
    score.views.push_back({showing[i]->name, i == 0, iou, std::move(masks[i])});
  }
  RETURN_IF_ERROR(ScoreChosen(connection, model, showing, score));
  return score;
}

}  // namespace pepeseg::cli
