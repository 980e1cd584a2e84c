#include "core/features/preparation.h"

#include <algorithm>
#include <future>
#include <nanoflann.hpp>
#include <span>
#include <string>
#include <utility>

#include "core/base/behind.h"
#include "core/features/gaussian_coverage.h"
#include "core/features/mask_agreement.h"
#include "core/features/mask_completion.h"
#include "core/features/mask_scales.h"
#include "core/priors/boundaries.h"
#include "kernels/ops/smooth.h"
#include "kernels/thread_pool.h"

namespace pepeseg {
namespace {

constexpr int64_t kChunk = 1024;  // Gaussians per task
constexpr size_t kLeafSize = 16;

// The means as a data set of nanoflann, which reads them in place.
struct MeanCloud {
  const Gaussians& gaussians;

  size_t kdtree_get_point_count() const { return static_cast<size_t>(gaussians.count); }
  float kdtree_get_pt(size_t i, size_t axis) const {
    return gaussians.Plane(kMeanPlane + static_cast<int>(axis))[i];
  }
  // Leaves the bounding box to nanoflann.
  template <class Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};
using KdTree = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<float, MeanCloud>,
                                                   MeanCloud, 3, int32_t>;

// Fills in the neighbours of Gaussian i. Of several Gaussians with the same mean the search may
// return any first, or leave out i itself: then i replaces the last one found.
void FindNeighbors(const KdTree& tree, const MeanCloud& cloud, int32_t i,
                   std::span<int32_t> neighbors) {
  float squared[kMaxNeighbors];
  const float mean[3] = {cloud.kdtree_get_pt(i, 0), cloud.kdtree_get_pt(i, 1),
                         cloud.kdtree_get_pt(i, 2)};
  // With fewer Gaussians than neighbours, the rest of the list repeats the Gaussian itself.
  std::fill(neighbors.begin(), neighbors.end(), i);
  const size_t found = tree.knnSearch(mean, neighbors.size(), neighbors.data(), squared);
  const auto end = neighbors.begin() + static_cast<int64_t>(found);
  const auto self = std::find(neighbors.begin(), end, i);
  // Moves i, or the last one found, to the front; the others keep their order by distance.
  std::rotate(neighbors.begin(), self == end ? end - 1 : self, self == end ? end : self + 1);
  neighbors[0] = i;
}

// Returns whether the perception loss has a weight, and depth to work with.
bool WantsPerception(const Capture& capture, const FeatureOptions& options) {
  return options.perception_weight > 0 && HasTrainingDepth(capture);
}

// Returns for a person why there is no perception loss.
std::string WhyNoPerception(const Capture& capture, const FeatureOptions& options) {
  if (options.perception_weight == 0) return "perception_weight is 0";
  if (!HasTrainingDepth(capture)) return "no training view has a depth prior";
  return "all pixels away from edges of the depth prior are under a mask or background";
}

// Returns FeatureField::scale_quantiles for the scales of all views.
std::vector<float> ScaleKnots(const std::vector<std::vector<float>>& scales, ScaleMapping mapping) {
  std::vector<float> all;
  for (const std::vector<float>& of_view : scales) {
    all.insert(all.end(), of_view.begin(), of_view.end());
  }
  if (mapping == ScaleMapping::kMinMax) return MinMaxScales(all);
  return mapping == ScaleMapping::kQuantiles ? ScaleQuantiles(all) : EvenScales(all);
}

// Returns the scales of all masks, by view of the capture, empty for views that are not trained on.
// Gives the depths to the reprojection. Works on a block of views at a time, to bound the memory:
// measures their masks in parallel while the device renders the depths of the next block.
std::vector<std::vector<float>> MeasureViews(const Capture& capture, Renderer& scene,
                                             Reprojection& reprojection) {
  const std::span<const int> trained = reprojection.views();
  int64_t num_pixels = 0;
  for (const int view : trained) {
    const Camera& camera = capture.views[view].camera;
    num_pixels = std::max(num_pixels, int64_t{camera.width} * camera.height);
  }
  const size_t most = ViewsInDepthBlock(num_pixels);
  std::vector<std::vector<float>> mask_scales(capture.views.size());
  std::vector<WeightedDepth> depths(most), next_depths(most);
  ThreadPool pool(0);
  Behind behind;
  for (size_t first = 0; first < trained.size(); first += most) {
    const std::span<const int> block =
        trained.subspan(first, std::min(most, trained.size() - first));
    for (size_t i = 0; i < block.size(); ++i) scene.Depth(capture.views[block[i]], next_depths[i]);
    behind.Wait();
    std::swap(depths, next_depths);
    behind.Do([&, block] {
      pool.ParallelFor(static_cast<int64_t>(block.size()), [&](int64_t i, int) {
        depths[i].Normalise();
        mask_scales[block[i]] = MaskScales(capture.views[block[i]], depths[i].depth);
        reprojection.KeepDepth(block[i], depths[i].depth);
      });
    });
  }
  behind.Wait();
  return mask_scales;
}

// Compares the masks of the views. Sets the scales of masks that stand alone to kNoScale, lets
// views share the scales of the same things, and adds the masks that a view lacks. Fills in
// mask_quality and completed_masks. Returns the masks that each view learns from, by view of the
// capture.
std::vector<const MaskSet*> ReconcileMasks(const Capture& capture, const FeatureOptions& options,
                                           std::vector<std::vector<float>>& mask_scales,
                                           PreparedFeatures& prepared) {
  const Reprojection& reprojection = *prepared.reprojection;
  // METHOD.md section 2, "Masks that disagree". Agreement is always that of the views' own masks,
  // before any is dropped or added.
  const MaskAgreements agreements = MeasureMaskAgreement(capture, reprojection);
  prepared.mask_quality = MaskQuality(capture, agreements);
  for (const int view : reprojection.views()) {
    for (size_t mask = 0; mask < agreements[view].size(); ++mask) {
      if (!StandsAlone(agreements[view][mask], options.min_mask_agreement)) continue;
      mask_scales[view][mask] = kNoScale;
    }
  }
  if (options.share_scales) ShareScales(agreements, mask_scales);
  std::vector<const MaskSet*> masks = OwnMasks(capture);
  prepared.completed_masks.resize(capture.views.size());
  if (!options.complete_masks || prepared.mask_quality.value_or(1) >= kCompleteBelow) return masks;
  std::vector<CompletedMasks> completed =
      CompleteMasks(capture, reprojection, agreements, mask_scales);
  for (const int view : reprojection.views()) {
    const std::vector<float>& added = completed[view].added_scales;
    if (added.empty()) continue;
    // CompletedMasks lists the own masks first, so that their numbers and scales stay valid.
    mask_scales[view].insert(mask_scales[view].end(), added.begin(), added.end());
    prepared.completed_masks[view] = std::move(completed[view].masks);
    masks[view] = &prepared.completed_masks[view];
  }
  return masks;
}

// Fills in the background and the unlabelled pixels of the views. Without background samples, its
// pixels are unlabelled ones, too. uncovered: by view of the capture, moved from.
void AddUncovered(std::vector<UncoveredPixels>& uncovered, const FeatureOptions& options,
                  std::vector<DrawableView>& views) {
  const bool with_background = options.num_background_pixels > 0;
  for (DrawableView& view : views) {
    UncoveredPixels& of_view = uncovered[view.view];
    view.unlabelled = std::move(of_view.covered_elsewhere);
    std::vector<int32_t>& to = with_background ? view.background : view.unlabelled;
    to.insert(to.end(), of_view.background.begin(), of_view.background.end());
  }
}

// Removes the unlabelled pixels near an edge of their view's depth prior, where the prior is not
// reliable, and all unlabelled pixels of views without a prior. Unless `wanted`, removes those of
// all views. Returns the edges [height, width], by view of the capture; empty for views without a
// depth prior or that are not drawn.
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

// Lists the parts of the loss that are left out, each with the reason.
std::vector<SkippedPart> SkippedParts(const Capture& capture, const FeatureOptions& options,
                                      const PreparedFeatures& prepared) {
  std::vector<SkippedPart> skipped;
  if (!Any(prepared.views, [](const auto& view) { return !view.background.empty(); })) {
    skipped.push_back(
        {Part::kBackground, options.num_background_pixels == 0
                                ? "num_background_pixels is 0"
                                : "everything seen is under a mask in at least one view"});
  }
  if (options.centroid_weight_upper == 0 && options.centroid_weight_lower == 0) {
    skipped.push_back({Part::kCentroids, "both centroid weights are 0"});
  }
  if (prepared.cues == nullptr) {
    skipped.push_back({Part::kPerception, WhyNoPerception(capture, options)});
  }
  return skipped;
}

}  // namespace

absl::StatusOr<PreparedFeatures> PrepareFeatures(Backend& backend, const Capture& capture,
                                                 const Gaussians& gaussians,
                                                 const FeatureOptions& options) {
  // Takes a while and uses no device: runs while the device renders.
  auto neighbors = std::async(std::launch::async,
                              [&] { return NearestNeighbors(gaussians, options.num_neighbors); });
  // The order matters: scales and the kept depths come from the renders, agreement needs the kept
  // depths, the views need the final masks and scales, and the cues need the views' unlabelled
  // pixels.
  const bool wants_perception = WantsPerception(capture, options);
  PreparedFeatures prepared{
      .capture = capture,
      .scene = std::make_unique<Renderer>(backend, gaussians, SceneRadius(capture)),
      .num_neighbors = options.num_neighbors};
  Renderer& scene = *prepared.scene;
  prepared.reprojection = std::make_unique<Reprojection>(capture, TrainedViews(capture));
  std::vector<std::vector<float>> mask_scales =
      MeasureViews(capture, scene, *prepared.reprojection);
  const std::vector<const MaskSet*> masks = ReconcileMasks(capture, options, mask_scales, prepared);
  prepared.field.scale_quantiles = ScaleKnots(mask_scales, options.scale_mapping);
  prepared.views = MakeDrawableViews(capture, masks, mask_scales);
  if (prepared.views.empty()) {
    return absl::FailedPreconditionError(
        "features: no training view has a mask of at least 8 pixels on which something is "
        "rendered");
  }
  const CoverageOptions looked_for = {
      .min_confident_views = options.min_confident_views,
      .find_uncovered = options.num_background_pixels > 0 || wants_perception};
  GaussianCoverage coverage = MeasureCoverage(backend, capture, masks, gaussians, looked_for);
  prepared.field.confidence = std::move(coverage.confidence);
  if (looked_for.find_uncovered) AddUncovered(coverage.uncovered, options, prepared.views);
  std::vector<std::vector<uint8_t>> edges =
      KeepAwayFromEdges(capture, wants_perception, prepared.views);
  if (Any(prepared.views, [](const auto& view) { return !view.unlabelled.empty(); })) {
    prepared.cross_view = std::make_unique<CrossView>(*prepared.reprojection, prepared.views);
    prepared.cues = std::make_unique<PerceptionCues>(capture, *prepared.cross_view, prepared.views,
                                                     std::move(edges), options);
  }
  prepared.skipped = SkippedParts(capture, options, prepared);
  prepared.neighbors = Buffer<int32_t>(backend, std::span<const int32_t>(neighbors.get()));
  return prepared;
}

size_t ViewsInDepthBlock(int64_t num_pixels) {
  constexpr int64_t kMostPixels = 16'000'000, kMostViews = 16;
  return static_cast<size_t>(
      std::clamp<int64_t>(kMostPixels / std::max<int64_t>(1, num_pixels), 1, kMostViews));
}

std::vector<int32_t> NearestNeighbors(const Gaussians& gaussians, int num_neighbors) {
  std::vector<int32_t> neighbors(gaussians.count * num_neighbors);
  if (gaussians.count == 0) return neighbors;
  const MeanCloud cloud = {gaussians};
  const KdTree tree(3, cloud, nanoflann::KDTreeSingleIndexAdaptorParams(kLeafSize));
  ThreadPool pool(0);
  pool.ParallelFor((gaussians.count + kChunk - 1) / kChunk, [&](int64_t chunk, int) {
    for (int64_t i = chunk * kChunk; i < std::min(gaussians.count, (chunk + 1) * kChunk); ++i) {
      FindNeighbors(tree, cloud, static_cast<int32_t>(i),
                    std::span(neighbors).subspan(i * num_neighbors, num_neighbors));
    }
  });
  return neighbors;
}

}  // namespace pepeseg
