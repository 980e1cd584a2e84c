#include "tests/bench/decomposition_scores.h"

#include <algorithm>
#include <cstdio>
#include <map>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "core/base/status_macros.h"
#include "core/evaluate/mask_scores.h"
#include "tests/bench/bench_backend.h"
#include "tests/bench/truth_views.h"

namespace pepeseg {
namespace {

// Returns the IoU of an entity and its best segment, mean over the entities.
double MeanBestIou(std::span<const int32_t> truth, std::span<const int32_t> shown,
                   const std::set<int32_t>& entities) {
  std::map<int32_t, int64_t> of_truth, of_shown;
  std::map<std::pair<int32_t, int32_t>, int64_t> of_both;
  for (size_t i = 0; i < truth.size(); ++i) {
    ++of_truth[truth[i]];
    ++of_shown[shown[i]];
    ++of_both[{truth[i], shown[i]}];
  }
  double sum = 0;
  for (const int32_t entity : entities) {
    double best = 0;
    for (const auto& [both, shared] : of_both) {
      if (both.first != entity || both.second == 0) continue;
      const int64_t either = of_truth[entity] + of_shown[both.second] - shared;
      best = std::max(best, static_cast<double>(shared) / static_cast<double>(either));
    }
    sum += best;
  }
  return sum / static_cast<double>(std::max<size_t>(1, entities.size()));
}

// Returns the id that most of an entity's pixels have, the smallest one among equals.
int32_t MajorityId(const TruthView& view, const std::string& entity, std::span<const int32_t> ids) {
  const std::vector<uint8_t> mask = view.CountedMaskOf(entity);
  std::map<int32_t, int64_t> counts;
  for (size_t i = 0; i < ids.size(); ++i) {
    if (mask[i] != 0) ++counts[ids[i]];
  }
  const auto most = std::ranges::max_element(
      counts, [](const auto& a, const auto& b) { return a.second < b.second; });
  return most == counts.end() ? 0 : most->first;
}

}  // namespace

absl::StatusOr<DecompositionScores> ScoreDecomposition(const Segmenter& segmenter, int level,
                                                       const EvaluationTask& task) {
  DecompositionScores scores;
  std::vector<int32_t> ids_of_gaussians;
  RETURN_IF_ERROR(
      segmenter.WithDecomposition(kDefaultDecompositionScales, [&](const Decomposition& whole) {
        ids_of_gaussians = whole.levels[level].ids;
        scores.num_segments = static_cast<int>(whole.levels[level].segments.size());
        return absl::OkStatus();
      }));
  std::vector<std::vector<int32_t>> images;
  images.reserve(task.views.size());
  std::vector<int32_t> truth, shown;
  for (const TruthView& view : task.views) {
    ASSIGN_OR_RETURN(const std::vector<int32_t> ids,
                     segmenter.RenderIds(view.view, ids_of_gaussians));
    for (const std::string& entity : view.entities) {
      const std::vector<uint8_t> mask = view.CountedMaskOf(entity);
      for (size_t i = 0; i < ids.size(); ++i) {
        if (mask[i] == 0) continue;
        truth.push_back(IdOf(entity));
        shown.push_back(ids[i]);
      }
    }
    images.push_back(ids);
  }
  scores.adjusted_rand = AdjustedRand(truth, shown);
  scores.unassigned_share = static_cast<double>(std::ranges::count(shown, 0)) /
                            static_cast<double>(std::max<size_t>(1, shown.size()));
  std::set<int32_t> entities;
  int num_kept = 0;
  for (const ScoredEntity& entity : task.entities) {
    entities.insert(IdOf(entity.name));
    std::vector<size_t> views = entity.scored;
    views.push_back(entity.reference);
    std::vector<int32_t> majorities;
    majorities.reserve(views.size());
    for (const size_t v : views) {
      majorities.push_back(MajorityId(task.views[v], entity.name, images[v]));
    }
    const bool kept = majorities[0] != 0 && std::ranges::count(majorities, majorities[0]) ==
                                                static_cast<std::ptrdiff_t>(majorities.size());
    if (kept) ++num_kept;
  }
  scores.num_entities = static_cast<int>(entities.size());
  scores.best_iou = MeanBestIou(truth, shown, entities);
  scores.kept_share = num_kept / static_cast<double>(std::max(1, scores.num_entities));
  return scores;
}

absl::Status PrintDecomposition(const Segmenter& segmenter, const CapturePack& pack) {
  const double start = Now();
  RETURN_IF_ERROR(segmenter.WithDecomposition(
      kDefaultDecompositionScales, [](const Decomposition&) { return absl::OkStatus(); }));
  std::printf("# decomposed in %.2f s\n", Now() - start);
  for (size_t level = 0; level < std::min(pack.truth.size(), kDefaultDecompositionScales.size());
       ++level) {
    EvaluationRequest request;
    ASSIGN_OR_RETURN(request.views, TruthViews(pack.capture, pack.truth[level]));
    ASSIGN_OR_RETURN(const EvaluationTask task, MakeTask(std::move(request), {}));
    ASSIGN_OR_RETURN(const DecompositionScores scores,
                     ScoreDecomposition(segmenter, static_cast<int>(level), task));
    std::printf(
        "# %s: %d segments, adjusted Rand index %.4f, best IoU %.4f, %.1f %% unassigned, %.1f %% "
        "of %d entities "
        "keep their id\n",
        pack.truth[level].name.c_str(), scores.num_segments, scores.adjusted_rand, scores.best_iou,
        100 * scores.unassigned_share, 100 * scores.kept_share, scores.num_entities);
  }
  return absl::OkStatus();
}

}  // namespace pepeseg
