#include "core/features/feature_preparation.h"

#include <algorithm>
#include <future>
#include <span>
#include <string>
#include <utility>

#include "core/features/feature_confidence.h"
#include "core/features/feature_trainer.h"
#include "core/features/is_trained.h"
#include "core/features/mask_coverage.h"
#include "core/features/mask_scales.h"
#include "core/features/neighbor_graph.h"
#include "core/priors/depth_edges.h"
#include "kernels/cpu/parallel_for.h"

namespace pepeseg {
namespace {

bool WantsPerception(const Capture& capture, const FeatureOptions& options) {
  return options.perception_weight > 0 && HasTrainingDepth(capture);
}

std::string WhyNoPerception(const Capture& capture, const FeatureOptions& options) {
  if (options.perception_weight == 0) return "perception_weight is 0";
  if (!HasTrainingDepth(capture)) return "no training view has a depth prior";
  return "masks or the background cover all pixels away from edges";
}

std::vector<float> ScaleKnots(const std::vector<std::vector<float>>& scales, ScaleMapping mapping) {
  std::vector<float> all;
  for (const std::vector<float>& of_view : scales) {
    all.insert(all.end(), of_view.begin(), of_view.end());
  }
  return mapping == ScaleMapping::kQuantiles ? ScaleQuantiles(all) : EvenScales(all);
}

// By view of the capture, none where a view is not trained on.
struct MeasuredViews {
  std::vector<std::vector<float>> mask_scales;  // of all masks
  std::vector<std::vector<float>> depths;       // see FrozenScene
};

// A block of views at a time: their depths are rendered, then their masks measured side by side.
MeasuredViews MeasureViews(const Capture& capture, FrozenScene& scene, bool keep_depths) {
  constexpr size_t kBlock = 16;
  MeasuredViews measured = {std::vector<std::vector<float>>(capture.views.size()),
                            std::vector<std::vector<float>>(capture.views.size())};
  std::vector<size_t> trained;
  for (size_t i = 0; i < capture.views.size(); ++i) {
    if (IsTrained(capture.views[i])) trained.push_back(i);
  }
  ThreadPool pool(0);
  for (size_t first = 0; first < trained.size(); first += kBlock) {
    const std::span<const size_t> block(trained.data() + first,
                                        std::min(kBlock, trained.size() - first));
    for (const size_t view : block) measured.depths[view] = scene.Depth(capture.views[view]);
    pool.ParallelFor(static_cast<int64_t>(block.size()), [&](int64_t i, int) {
      const size_t view = block[i];
      measured.mask_scales[view] = MaskScales(capture.views[view], measured.depths[view]);
    });
    if (keep_depths) continue;
    for (const size_t view : block) measured.depths[view] = {};
  }
  return measured;
}

void AddUncovered(const Capture& capture, FrozenScene& scene, const FeatureOptions& options,
                  std::vector<DrawableView>& views) {
  const bool with_background = options.num_background_pixels > 0;
  if (!with_background && !WantsPerception(capture, options)) return;
  std::vector<UncoveredPixels> uncovered = FindUncovered(capture, scene);
  for (DrawableView& view : views) {
    UncoveredPixels& of_view = uncovered[view.view];
    view.unlabelled = std::move(of_view.covered_elsewhere);
    std::vector<int32_t>& to = with_background ? view.background : view.unlabelled;
    to.insert(to.end(), of_view.background.begin(), of_view.background.end());
  }
}

// Without those near an edge of the view's prior: they are told nothing. The edges by view of the
// capture.
std::vector<std::vector<uint8_t>> KeepAwayFromEdges(const Capture& capture, bool wanted,
                                                    std::vector<DrawableView>& views) {
  std::vector<std::vector<uint8_t>> edges(capture.views.size());
  ThreadPool pool(0);
  pool.ParallelFor(static_cast<int64_t>(views.size()), [&](int64_t i, int) {
    std::vector<int32_t>& unlabelled = views[i].unlabelled;
    const View& view = capture.views[views[i].view];
    if (!wanted || !HasDepthPrior(view)) return unlabelled.clear();
    std::vector<uint8_t>& of_view = edges[views[i].view] = DepthEdges(view);
    std::erase_if(unlabelled, [&](int32_t p) { return of_view[p] != 0; });
  });
  return edges;
}

template <class HasPixels>
bool Any(const std::vector<DrawableView>& views, HasPixels has_pixels) {
  return std::any_of(views.begin(), views.end(), has_pixels);
}

std::vector<SkippedTerm> SkippedTerms(const Capture& capture, const FeatureOptions& options,
                                      const PreparedFeatures& prepared) {
  std::vector<SkippedTerm> skipped;
  if (!Any(prepared.views, [](const auto& view) { return !view.background.empty(); })) {
    skipped.push_back({"background", options.num_background_pixels == 0
                                         ? "num_background_pixels is 0"
                                         : "masks cover all that is seen in some view"});
  }
  if (options.centroid_weight_upper == 0 && options.centroid_weight_lower == 0) {
    skipped.push_back({"centroids", "both centroid weights are 0"});
  }
  if (prepared.cues == nullptr) {
    skipped.push_back({"perception", WhyNoPerception(capture, options)});
  }
  return skipped;
}

}  // namespace

absl::StatusOr<PreparedFeatures> PrepareFeatures(const Capture& capture, const Gaussians& gaussians,
                                                 FrozenScene& scene,
                                                 const FeatureOptions& options) {
  // Beside the device's work.
  auto neighbors = std::async(std::launch::async,
                              [&] { return NearestNeighbors(gaussians, options.num_neighbors); });
  auto features = std::async(std::launch::async, [&] {
    return FeatureTrainer::InitialFeatures(gaussians.count, options);
  });
  const bool wants_perception = WantsPerception(capture, options);
  const MeasuredViews measured = MeasureViews(capture, scene, wants_perception);
  PreparedFeatures prepared;
  prepared.scale_quantiles = ScaleKnots(measured.mask_scales, options.scale_mapping);
  prepared.views = MakeDrawableViews(capture, measured.mask_scales);
  if (prepared.views.empty()) {
    return absl::FailedPreconditionError(
        "features: no training view has a mask of at least 8 pixels on which something is "
        "rendered");
  }
  if (options.sure_views > 0) {
    prepared.confidence = FeatureConfidence(capture, scene, options.sure_views);
  }
  AddUncovered(capture, scene, options, prepared.views);
  std::vector<std::vector<uint8_t>> edges =
      KeepAwayFromEdges(capture, wants_perception, prepared.views);
  if (Any(prepared.views, [](const auto& view) { return !view.unlabelled.empty(); })) {
    prepared.cross_view = std::make_unique<CrossView>(capture, prepared.views, measured.depths);
    prepared.cues = std::make_unique<PerceptionCues>(capture, *prepared.cross_view, prepared.views,
                                                     std::move(edges), options);
  }
  prepared.skipped = SkippedTerms(capture, options, prepared);
  prepared.neighbors = neighbors.get();
  prepared.features = features.get();
  return prepared;
}

}  // namespace pepeseg
