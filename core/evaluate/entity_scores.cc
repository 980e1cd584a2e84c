#include "core/evaluate/entity_scores.h"

#include <algorithm>
#include <utility>

#include "core/base/status_macros.h"
#include "core/evaluate/reference_choice.h"

namespace pepeseg {
namespace {

// IoU at every scale and threshold, [scales * thresholds].
using IouTable = std::vector<double>;

// An entity during the evaluation.
struct Tables {
  std::optional<ReferenceTruth> reference_truth;
  IouTable reference;  // in the reference view; empty: nothing is known there
  IouTable scored;     // sum over the scored views
};

class QueryScorer {
 public:
  QueryScorer(const QueryTask& query_task, std::span<const EntityQueries> queries,
              const ChoiceThresholds& choice, const MaskInView& mask_in_view)
      : query_task_(query_task),
        segmenter_(query_task.segmenter),
        task_(query_task.task),
        queries_(queries),
        choice_(choice),
        mask_in_view_(mask_in_view),
        thresholds_(choice.thresholds) {
    thresholds_.push_back(choice.fixed_threshold);
    std::sort(thresholds_.begin(), thresholds_.end());
    thresholds_.erase(std::unique(thresholds_.begin(), thresholds_.end()), thresholds_.end());
  }

  absl::StatusOr<std::vector<EntityScores>> Run() {
    for (size_t i = 0; i < task_.entities.size(); ++i) Begin(i);
    for (size_t v = 0; v < task_.views.size(); ++v) RETURN_IF_ERROR(Tabulate(v));
    for (size_t i = 0; i < task_.entities.size(); ++i) Choose(i);
    // Backwards: the last maps of the first pass are still cached.
    for (size_t v = task_.views.size(); v > 0; --v) RETURN_IF_ERROR(ScoreChoices(v - 1));
    for (EntityScores& score : scores_) {
      score.paper.mean = MeanOf(score.paper.views);
      if (score.reference_choice) {
        score.reference_choice->mean = MeanOf(score.reference_choice->views);
        // The tables are of masks whose borders are not refined: of refined ones the reference's
        // choice from the same grid may be the better one in the scored views.
        if (score.reference_choice->mean.iou > score.paper.mean.iou) {
          score.paper = *score.reference_choice;
        }
      }
      score.automatic.mean = MeanOf(score.automatic.views);
    }
    return std::move(scores_);
  }

 private:
  void Begin(size_t index);
  absl::Status Tabulate(size_t view);
  absl::Status AddIous(size_t view, const Query& query, const ReferenceTruth& truth,
                       std::span<double> ious) const;
  void Choose(size_t index);
  ChoiceScores ChoiceFrom(const IouTable& ious, ReferenceRule rule) const;
  absl::Status ScoreChoices(size_t view);
  absl::StatusOr<BinaryMask> MaskIn(size_t view, const Query& query) const;
  absl::StatusOr<MaskScores> ScoresIn(size_t view, const Query& query,
                                      std::span<const uint8_t> truth) const;
  Query QueryOf(size_t index, const ChoiceScores& choice) const;

  size_t Place(size_t scale, double threshold) const {
    const auto at = std::lower_bound(thresholds_.begin(), thresholds_.end(), threshold);
    return scale * thresholds_.size() + static_cast<size_t>(at - thresholds_.begin());
  }
  // Returns the index of a view among the scored views of an entity, or their number.
  static size_t PlaceOf(const ScoredEntity& entity, size_t view) {
    return static_cast<size_t>(std::find(entity.scored.begin(), entity.scored.end(), view) -
                               entity.scored.begin());
  }

  const QueryTask& query_task_;
  const Segmenter& segmenter_;
  const EvaluationTask& task_;
  const std::span<const EntityQueries> queries_;
  const ChoiceThresholds& choice_;
  const MaskInView& mask_in_view_;
  std::vector<double> thresholds_;    // those of the choice and the fixed one, ascending
  std::vector<Tables> tables_;        // [entities]
  std::vector<EntityScores> scores_;  // [entities]
};

void QueryScorer::Begin(size_t index) {
  const ScoredEntity& entity = task_.entities[index];
  EntityScores& score = scores_.emplace_back(WithoutScores(task_, entity));
  score.missing = queries_[index].missing();
  Tables& tables = tables_.emplace_back();
  tables.reference_truth = ReferenceTruthOf(task_, entity);
  const size_t size = query_task_.scales.size() * thresholds_.size();
  tables.scored.assign(size, 0);
  if (tables.reference_truth) tables.reference.assign(size, 0);
}

// Adds the IoU of a query at each threshold to `ious`.
absl::Status QueryScorer::AddIous(size_t view, const Query& query, const ReferenceTruth& truth,
                                  std::span<double> ious) const {
  if (query.features.empty()) return absl::OkStatus();
  if (mask_in_view_) {
    ASSIGN_OR_RETURN(const BinaryMask mask, mask_in_view_(view, query));
    const double iou = Iou(mask.pixels, truth.mask, truth.ignore);
    for (double& sum : ious) sum += iou;
    return absl::OkStatus();
  }
  // The mask at the lowest threshold leaves out what a negative feature claims; all others are
  // parts of it.
  Query widest = query;
  widest.threshold = thresholds_.front();
  ASSIGN_OR_RETURN(
      const std::vector<SegmentResult> results,
      segmenter_.Segment(widest, {&task_.views[view].view, 1}, {.want_similarity = true}));
  const std::vector<double> found = IouByThreshold(results[0].similarity, results[0].mask.pixels,
                                                   truth.mask, truth.ignore, thresholds_);
  for (size_t t = 0; t < found.size(); ++t) ious[t] += found[t];
  return absl::OkStatus();
}

absl::Status QueryScorer::Tabulate(size_t view) {
  const TruthView& truth = task_.views[view];
  for (size_t i = 0; i < task_.entities.size(); ++i) {
    const ScoredEntity& entity = task_.entities[i];
    Tables& tables = tables_[i];
    const bool is_scored = PlaceOf(entity, view) < entity.scored.size();
    const bool is_reference = entity.reference == view && tables.reference_truth;
    if (scores_[i].missing || (!is_scored && !is_reference)) continue;
    ReferenceTruth here;
    if (is_scored) here = {truth.MaskOf(entity.name), truth.ignore};
    for (size_t s = 0; s < query_task_.scales.size(); ++s) {
      RETURN_IF_ERROR(query_task_.check_cancelled());
      const Query& query = queries_[i].by_scale[s];
      const size_t first = s * thresholds_.size();
      if (is_scored) {
        RETURN_IF_ERROR(AddIous(view, query, here,
                                std::span(tables.scored).subspan(first, thresholds_.size())));
      }
      if (is_reference) {
        RETURN_IF_ERROR(AddIous(view, query, *tables.reference_truth,
                                std::span(tables.reference).subspan(first, thresholds_.size())));
      }
    }
  }
  return absl::OkStatus();
}

// Leaves out the fixed threshold where it is not one to choose from.
ChoiceScores QueryScorer::ChoiceFrom(const IouTable& ious, ReferenceRule rule) const {
  const std::span<const double> scales = query_task_.scales;
  IouTable grid;
  for (size_t s = 0; s < scales.size(); ++s) {
    for (const double threshold : choice_.thresholds) grid.push_back(ious[Place(s, threshold)]);
  }
  const GridCell cell = rule == ReferenceRule::kBest
                            ? BestCell(grid, choice_.thresholds.size())
                            : ChooseFromReference(grid, scales, choice_.thresholds);
  ChoiceScores choice;
  choice.scale = scales[cell.scale];
  choice.threshold = choice_.thresholds[cell.threshold];
  return choice;
}

void QueryScorer::Choose(size_t index) {
  const Tables& tables = tables_[index];
  EntityScores& score = scores_[index];
  const size_t num_scored = score.scored.size();
  for (size_t s = 0; s < query_task_.scales.size(); ++s) {
    score.iou_by_scale.push_back(tables.scored[Place(s, choice_.fixed_threshold)] /
                                 static_cast<double>(num_scored));
  }
  if (tables.reference_truth) score.reference_choice = ChoiceScores();
  if (!score.missing) {
    score.paper = ChoiceFrom(tables.scored, ReferenceRule::kBest);
    if (tables.reference_truth) score.reference_choice = ChoiceFrom(tables.reference, choice_.rule);
    score.automatic.scale = queries_[index].automatic.scale;
    score.automatic.threshold = queries_[index].automatic.threshold;
  }
  score.paper.views.resize(num_scored);
  if (score.reference_choice) score.reference_choice->views.resize(num_scored);
  score.automatic.views.resize(num_scored);
}

// Returns the query of a choice from the grid.
Query QueryScorer::QueryOf(size_t index, const ChoiceScores& choice) const {
  const auto at = std::find(query_task_.scales.begin(), query_task_.scales.end(), choice.scale);
  Query query = queries_[index].by_scale[static_cast<size_t>(at - query_task_.scales.begin())];
  query.threshold = choice.threshold;
  return query;
}

absl::StatusOr<BinaryMask> QueryScorer::MaskIn(size_t view, const Query& query) const {
  if (mask_in_view_) return mask_in_view_(view, query);
  ASSIGN_OR_RETURN(std::vector<SegmentResult> results,
                   segmenter_.Segment(query, {&task_.views[view].view, 1},
                                      {.refine_borders = query_task_.refine_borders}));
  return std::move(results[0].mask);
}

absl::StatusOr<MaskScores> QueryScorer::ScoresIn(size_t view, const Query& query,
                                                 std::span<const uint8_t> truth) const {
  if (query.features.empty()) return MaskScores();
  const TruthView& in = task_.views[view];
  ASSIGN_OR_RETURN(const BinaryMask mask, MaskIn(view, query));
  return ScoreMask(mask.pixels, truth, in.view.camera.width, in.view.camera.height, in.ignore);
}

absl::Status QueryScorer::ScoreChoices(size_t view) {
  for (size_t i = 0; i < task_.entities.size(); ++i) {
    EntityScores& score = scores_[i];
    const size_t place = PlaceOf(task_.entities[i], view);
    if (place == score.scored.size() || score.missing) continue;
    RETURN_IF_ERROR(query_task_.check_cancelled());
    const std::vector<uint8_t> truth = task_.views[view].MaskOf(score.name);
    ASSIGN_OR_RETURN(score.paper.views[place], ScoresIn(view, QueryOf(i, score.paper), truth));
    ASSIGN_OR_RETURN(score.automatic.views[place], ScoresIn(view, queries_[i].automatic, truth));
    if (!score.reference_choice) continue;
    ChoiceScores& choice = *score.reference_choice;
    if (choice.scale == score.paper.scale && choice.threshold == score.paper.threshold) {
      choice.views[place] = score.paper.views[place];
    } else {
      ASSIGN_OR_RETURN(choice.views[place], ScoresIn(view, QueryOf(i, choice), truth));
    }
  }
  return absl::OkStatus();
}

}  // namespace

EntityScores WithoutScores(const EvaluationTask& task, const ScoredEntity& entity) {
  EntityScores score;
  score.name = entity.name;
  score.category = entity.category;
  score.reference = task.views[entity.reference].view.name;
  for (const size_t v : entity.scored) score.scored.push_back(task.views[v].view.name);
  score.num_pixels = entity.num_pixels;
  if (std::holds_alternative<DeepestClick>(entity.prompt)) {
    score.click = DeepestClickOf(task, entity);
  }
  return score;
}

absl::StatusOr<std::vector<EntityScores>> ScoreQueries(const QueryTask& query_task,
                                                       std::span<const EntityQueries> queries,
                                                       const ChoiceThresholds& choice,
                                                       const MaskInView& mask_in_view) {
  return QueryScorer(query_task, queries, choice, mask_in_view).Run();
}

}  // namespace pepeseg
