#include "core/evaluate/one_click.h"

#include <algorithm>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/evaluate/segmentation_metrics.h"
#include "kernels/ops/render.h"

namespace pepeseg {
namespace {

constexpr size_t kMaxGrid = 100;
constexpr int64_t kMaxSimilarities = int64_t{16} << 20;  // values of one query: 64 MiB

absl::Status CheckAscending(const std::string& name, const std::vector<double>& values,
                            double low) {
  if (values.empty() || values.size() > kMaxGrid) {
    return absl::InvalidArgumentError(
        absl::StrCat(name, " has ", values.size(), " values, must have 1..", kMaxGrid));
  }
  for (size_t i = 0; i < values.size(); ++i) {
    const bool ascends = i == 0 || values[i] > values[i - 1];
    if (values[i] >= low && values[i] <= 1 && ascends) continue;  // false for NaN
    return absl::InvalidArgumentError(
        absl::StrCat(name, "[", i, "] is ", values[i], ", must be in [", low, ", 1] and ascend"));
  }
  return absl::OkStatus();
}

std::vector<double> Merged(std::vector<double> values, const std::vector<double>& others) {
  values.insert(values.end(), others.begin(), others.end());
  std::sort(values.begin(), values.end());
  values.erase(std::unique(values.begin(), values.end()), values.end());
  return values;
}

size_t IndexOf(const std::vector<double>& values, double value) {
  return std::lower_bound(values.begin(), values.end(), value) - values.begin();
}

// An entity during the evaluation: its feature, and its IoU at every scale and threshold.
struct Asked {
  const ShownEntity* entity;
  std::vector<float> feature;                          // [32]; empty: no feature under the click
  std::vector<std::vector<std::vector<double>>> ious;  // [view of the entity][scale][threshold]
};

// Returns the index of a view among the entity's views, or their number if it is not one of them.
size_t PlaceOf(const ShownEntity& entity, const LabeledView& view) {
  return std::find(entity.views.begin(), entity.views.end(), &view) - entity.views.begin();
}

// Evaluates view by view rather than entity by entity, so that each feature map is rendered once
// and serves all entities that its view shows: first the IoU of every entity, view, scale and
// threshold (Tabulate), then the choice (Choose), then the boundary IoU of the chosen pairs only.
class Evaluation {
 public:
  Evaluation(const Segmenter& segmenter, std::span<const LabeledView> views,
             const OneClickOptions& options, absl::FunctionRef<absl::Status()> check_cancelled)
      : segmenter_(segmenter),
        views_(views),
        options_(options),
        check_cancelled_(check_cancelled),
        scales_(Merged(options.scales, options.fixed_scales)),
        thresholds_(Merged(options.thresholds, {options.fixed_threshold})) {}

  absl::StatusOr<OneClickScores> Run() {
    RETURN_IF_ERROR(Find());
    for (size_t i = 0; i < asked_.size(); ++i) RETURN_IF_ERROR(Click(i));
    for (const LabeledView& view : views_) {
      for (size_t s = 0; s < scales_.size(); ++s) RETURN_IF_ERROR(Tabulate(view, s));
    }
    for (size_t i = 0; i < asked_.size(); ++i) Choose(i);
    for (const LabeledView& view : views_) RETURN_IF_ERROR(ScoreBoundaries(view));
    TakeMeans();
    return std::move(scores_);
  }

 private:
  absl::Status Find();
  absl::Status Click(size_t index);
  absl::Status Tabulate(const LabeledView& view, size_t scale);
  absl::Status TabulateSome(const LabeledView& view, size_t scale, std::span<Asked* const> some);
  void Choose(size_t index);
  absl::Status ScoreBoundaries(const LabeledView& view);
  absl::StatusOr<double> BoundaryAt(const Asked& asked, const LabeledView& view,
                                    const OneClickChoice& choice);
  void TakeMeans();

  // Returns the mean IoU over views [first, last) of the entity.
  static double MeanIou(const Asked& asked, size_t first, size_t last, size_t scale,
                        size_t threshold) {
    double sum = 0;
    for (size_t v = first; v < last; ++v) sum += asked.ious[v][scale][threshold];
    return sum / static_cast<double>(last - first);
  }
  // Returns the pair of the grid with the best mean IoU over views [first, last) of the entity.
  OneClickChoice Best(const Asked& asked, size_t first, size_t last) const;

  const Segmenter& segmenter_;
  const std::span<const LabeledView> views_;
  const OneClickOptions& options_;
  const absl::FunctionRef<absl::Status()> check_cancelled_;
  const std::vector<double> scales_,
      thresholds_;  // the union of those to choose from and the fixed ones, ascending
  std::vector<ShownEntity> shown_;
  std::vector<Asked> asked_;  // parallel to scores_.entities
  OneClickScores scores_;
};

absl::Status Evaluation::Find() {
  ASSIGN_OR_RETURN(ScoredEntities found, FindScoredEntities(views_, options_.min_pixels));
  scores_.left_out = std::move(found.left_out);
  shown_ = std::move(found.entities);
  for (const ShownEntity& entity : shown_) {
    asked_.push_back({&entity, {}, {}});
    EntityScore& score = scores_.entities.emplace_back();
    score.id = entity.id;
    for (size_t v = 0; v < entity.views.size(); ++v) {
      score.views.push_back({entity.views[v]->view.name, entity.num_pixels[v], 0, 0, {}});
    }
  }
  return absl::OkStatus();
}

// A click that is refused is a missing prediction, not an error.
absl::Status Evaluation::Click(size_t index) {
  RETURN_IF_ERROR(check_cancelled_());
  Asked& asked = asked_[index];
  EntityScore& score = scores_.entities[index];
  const LabeledView& reference = *asked.entity->views[0];
  score.click = FirstClick(*asked.entity);
  auto feature = segmenter_.PointFeatures(reference.view, {&score.click, 1});
  score.missing = absl::IsInvalidArgument(feature.status());
  if (!score.missing) RETURN_IF_ERROR(feature.status());
  if (feature.ok()) asked.feature = *std::move(feature);
  asked.ious.assign(asked.entity->views.size(),
                    std::vector(scales_.size(), std::vector<double>(thresholds_.size())));
  return absl::OkStatus();
}

// Scores all entities of a view at one scale, in as few passes over its feature map as
// kMaxSimilarities allows.
absl::Status Evaluation::Tabulate(const LabeledView& view, size_t scale) {
  std::vector<Asked*> here;
  for (Asked& asked : asked_) {
    const bool shows = PlaceOf(*asked.entity, view) < asked.entity->views.size();
    if (shows && !asked.feature.empty()) here.push_back(&asked);
  }
  const auto num_pixels = static_cast<int64_t>(view.labels.size());
  const auto at_once = static_cast<size_t>(std::max<int64_t>(1, kMaxSimilarities / num_pixels));
  for (size_t first = 0; first < here.size(); first += at_once) {
    const std::span<Asked* const> rest = std::span(here).subspan(first);
    RETURN_IF_ERROR(TabulateSome(view, scale, rest.first(std::min(at_once, rest.size()))));
  }
  return absl::OkStatus();
}

absl::Status Evaluation::TabulateSome(const LabeledView& view, size_t scale,
                                      std::span<Asked* const> some) {
  RETURN_IF_ERROR(check_cancelled_());
  std::vector<float> features;
  for (const Asked* asked : some) {
    features.insert(features.end(), asked->feature.begin(), asked->feature.end());
  }
  ASSIGN_OR_RETURN(const std::vector<float> similarity,
                   segmenter_.Similarity(features, scales_[scale], view.view));
  const size_t num_pixels = view.labels.size();
  for (size_t i = 0; i < some.size(); ++i) {
    some[i]->ious[PlaceOf(*some[i]->entity, view)][scale] =
        IouByThreshold(std::span(similarity).subspan(i * num_pixels, num_pixels), view,
                       some[i]->entity->id, thresholds_);
  }
  return absl::OkStatus();
}

OneClickChoice Evaluation::Best(const Asked& asked, size_t first, size_t last) const {
  OneClickChoice best;
  best.iou = -1;
  for (const double scale : options_.scales) {
    for (const double threshold : options_.thresholds) {
      const double iou =
          MeanIou(asked, first, last, IndexOf(scales_, scale), IndexOf(thresholds_, threshold));
      if (iou > best.iou) best = {scale, threshold, iou, 0};
    }
  }
  return best;
}

void Evaluation::Choose(size_t index) {
  const Asked& asked = asked_[index];
  EntityScore& score = scores_.entities[index];
  const size_t num_views = asked.entity->views.size();
  const size_t fixed_threshold = IndexOf(thresholds_, options_.fixed_threshold);
  for (const double fixed : options_.fixed_scales) {
    const size_t scale = IndexOf(scales_, fixed);
    score.fixed_iou.push_back(MeanIou(asked, 1, num_views, scale, fixed_threshold));
    for (size_t v = 0; v < num_views; ++v) {
      score.views[v].fixed_iou.push_back(asked.ious[v][scale][fixed_threshold]);
    }
  }
  if (score.missing) return;
  score.oracle = Best(asked, 1, num_views);
  score.chosen = Best(asked, 0, 1);
  const size_t scale = IndexOf(scales_, score.chosen.scale);
  const size_t threshold = IndexOf(thresholds_, score.chosen.threshold);
  score.chosen.iou = MeanIou(asked, 1, num_views, scale, threshold);
  for (size_t v = 0; v < num_views; ++v) score.views[v].iou = asked.ious[v][scale][threshold];
}

absl::StatusOr<double> Evaluation::BoundaryAt(const Asked& asked, const LabeledView& view,
                                              const OneClickChoice& choice) {
  RETURN_IF_ERROR(check_cancelled_());
  ASSIGN_OR_RETURN(const std::vector<float> similarity,
                   segmenter_.Similarity(asked.feature, choice.scale, view.view));
  std::vector<uint8_t> prediction(similarity.size()), truth(similarity.size());
  for (size_t i = 0; i < prediction.size(); ++i) {
    prediction[i] = similarity[i] > static_cast<float>(choice.threshold) ? 1 : 0;
    truth[i] = view.labels[i] == asked.entity->id ? 1 : 0;
  }
  const Camera& camera = view.view.camera;
  return BoundaryIou(prediction, truth, camera.width, camera.height, view.ignore);
}

absl::Status Evaluation::ScoreBoundaries(const LabeledView& view) {
  for (size_t i = 0; i < asked_.size(); ++i) {
    const Asked& asked = asked_[i];
    const size_t num_views = asked.entity->views.size();
    const size_t place = PlaceOf(*asked.entity, view);
    if (place == num_views || asked.feature.empty()) continue;
    EntityScore& score = scores_.entities[i];
    ASSIGN_OR_RETURN(const double chosen, BoundaryAt(asked, view, score.chosen));
    score.views[place].boundary_iou = chosen;
    if (place == 0) continue;
    double oracle = chosen;
    if (score.oracle.scale != score.chosen.scale ||
        score.oracle.threshold != score.chosen.threshold) {
      ASSIGN_OR_RETURN(oracle, BoundaryAt(asked, view, score.oracle));
    }
    score.chosen.boundary_iou += chosen / static_cast<double>(num_views - 1);
    score.oracle.boundary_iou += oracle / static_cast<double>(num_views - 1);
  }
  return absl::OkStatus();
}

void Evaluation::TakeMeans() {
  const auto count = static_cast<double>(scores_.entities.size());
  scores_.fixed_iou.assign(options_.fixed_scales.size(), 0);
  for (const EntityScore& score : scores_.entities) {
    scores_.chosen.iou += score.chosen.iou / count;
    scores_.chosen.boundary_iou += score.chosen.boundary_iou / count;
    scores_.oracle.iou += score.oracle.iou / count;
    scores_.oracle.boundary_iou += score.oracle.boundary_iou / count;
    for (size_t k = 0; k < scores_.fixed_iou.size(); ++k) {
      scores_.fixed_iou[k] += score.fixed_iou[k] / count;
    }
  }
}

}  // namespace

absl::Status Validate(const OneClickOptions& options) {
  RETURN_IF_ERROR(CheckAscending("scales", options.scales, 0));
  RETURN_IF_ERROR(CheckAscending("thresholds", options.thresholds, -1));
  RETURN_IF_ERROR(CheckAscending("fixed_scales", options.fixed_scales, 0));
  RETURN_IF_ERROR(CheckAscending("fixed_threshold", {options.fixed_threshold}, -1));
  if (options.min_pixels >= 1) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat("min_pixels is ", options.min_pixels, ", must be at least 1"));
}

absl::StatusOr<OneClickScores> EvaluateOneClick(const Segmenter& segmenter,
                                                std::span<const LabeledView> views,
                                                const OneClickOptions& options,
                                                absl::FunctionRef<absl::Status()> check_cancelled) {
  RETURN_IF_ERROR(Validate(options));
  return Evaluation(segmenter, views, options, check_cancelled).Run();
}

}  // namespace pepeseg
