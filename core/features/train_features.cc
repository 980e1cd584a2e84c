#include "core/features/train_features.h"

#include <algorithm>
#include <cmath>
#include <future>
#include <span>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/features/batch_drawer.h"
#include "core/features/batches_ahead.h"
#include "core/features/centroid_term.h"
#include "core/features/feature_trainer.h"
#include "core/features/frozen_scene.h"
#include "core/features/mask_coverage.h"
#include "core/features/mask_scales.h"
#include "core/features/neighbor_graph.h"
#include "core/features/row_chunk.h"
#include "core/status_macros.h"
#include "kernels/cpu/parallel_for.h"

namespace pepeseg {
namespace {

constexpr int kFeatureStep = 100;  // of Backend::Sequence; stage one has the small numbers

template <class T>
absl::Status CheckRange(const char* name, T value, T low, T high) {
  if (value >= low && value <= high) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat("features: ", name, " is ", value, ", must be in [", low, ", ", high, "]"));
}

// Scales of all masks of each view that is trained on; none for the others. A block of views at a
// time: their depths are rendered, then measured side by side.
std::vector<std::vector<float>> MeasureMasks(const Capture& capture, FrozenScene& scene) {
  constexpr size_t kBlock = 16;
  std::vector<std::vector<float>> scales(capture.views.size());
  std::vector<size_t> trained;
  for (size_t i = 0; i < capture.views.size(); ++i) {
    if (!capture.views[i].held_out && !capture.views[i].masks.empty()) trained.push_back(i);
  }
  ThreadPool pool(0);
  for (size_t first = 0; first < trained.size(); first += kBlock) {
    const size_t count = std::min(kBlock, trained.size() - first);
    std::vector<std::vector<float>> depths;
    for (size_t i = 0; i < count; ++i) {
      depths.push_back(scene.Depth(capture.views[trained[first + i]]));
    }
    pool.ParallelFor(static_cast<int64_t>(count), [&](int64_t i, int) {
      const size_t view = trained[first + i];
      scales[view] = MaskScales(capture.views[view], depths[i]);
    });
  }
  return scales;
}

std::vector<float> AllScales(const std::vector<std::vector<float>>& scales) {
  std::vector<float> all;
  for (const std::vector<float>& of_view : scales) {
    all.insert(all.end(), of_view.begin(), of_view.end());
  }
  return all;
}

// What is known before the first step.
struct Prepared {
  FeatureField field;
  std::vector<DrawableView> views;
  std::vector<int32_t> neighbors;
};

absl::StatusOr<Prepared> Prepare(const Capture& capture, const Gaussians& gaussians,
                                 FrozenScene& scene, const FeatureOptions& options) {
  Prepared prepared;
  auto neighbors = std::async(std::launch::async, [&] {  // beside the device's work
    return NearestNeighbors(gaussians, options.num_neighbors);
  });
  const std::vector<std::vector<float>> scales = MeasureMasks(capture, scene);
  prepared.field.scale_quantiles = ScaleQuantiles(AllScales(scales));
  prepared.views = MakeDrawableViews(capture, scales);
  if (prepared.views.empty()) {
    return absl::FailedPreconditionError(
        "features: no training view has a mask of at least 8 pixels on which something is "
        "rendered");
  }
  if (options.num_background_pixels > 0) {
    const std::vector<std::vector<int32_t>> background = BackgroundPixels(capture, scene);
    for (DrawableView& view : prepared.views) view.background = background[view.view];
  }
  prepared.neighbors = neighbors.get();
  return prepared;
}

// How many steps are queued before the host waits for their losses.
int StepsUnread(const Backend& backend) { return std::max(1, 4 * backend.queue_depth()); }

// Tells the losses of the steps up to `report`'s, one after the other.
absl::Status TellLosses(std::span<const double> losses, StepReport report, const Backend& backend,
                        ProgressFn progress) {
  report.step -= static_cast<int>(losses.size());
  for (const double loss : losses) {
    ++report.step;
    report.loss = loss;
    if (!backend.error().empty() || !std::isfinite(loss)) {
      return absl::InternalError(
          absl::StrCat("features: step ", report.step, ": loss ", loss, " ", backend.error()));
    }
    RETURN_IF_ERROR(progress(report));
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status Validate(const FeatureOptions& options) {
  RETURN_IF_ERROR(CheckRange("num_steps", options.num_steps, 1, 10'000'000));
  RETURN_IF_ERROR(CheckRange("num_pixels", options.num_pixels, 2, 16'384));
  RETURN_IF_ERROR(CheckRange("num_background_pixels", options.num_background_pixels, 0, 16'384));
  RETURN_IF_ERROR(CheckRange("num_scales", options.num_scales, 1, kMaxScales));
  RETURN_IF_ERROR(CheckRange("learning_rate_final", options.learning_rate_final, 1e-8f, 1.0f));
  RETURN_IF_ERROR(CheckRange("centroid_from", options.centroid_from, 0.0, 1.0));
  RETURN_IF_ERROR(CheckRange("centroid_every", options.centroid_every, 1, 10'000'000));
  RETURN_IF_ERROR(CheckRange("centroid_pixels", options.centroid_pixels, 1, 65'536));
  RETURN_IF_ERROR(CheckRange("centroid_weight_upper", options.centroid_weight_upper, 0.0f, 100.0f));
  RETURN_IF_ERROR(CheckRange("centroid_weight_lower", options.centroid_weight_lower, 0.0f, 100.0f));
  RETURN_IF_ERROR(CheckRange("num_neighbors", options.num_neighbors, 1, kMaxNeighbors));
  RETURN_IF_ERROR(
      CheckRange("num_drawn_neighbors", options.num_drawn_neighbors, 1, options.num_neighbors));
  RETURN_IF_ERROR(CheckRange("learning_rate", options.learning_rate, 1e-8f, 1.0f));
  return CheckRange("steps_per_chunk", options.steps_per_chunk, 1, 100'000);
}

absl::StatusOr<FeatureField> TrainFeatures(Backend& backend, const Capture& capture,
                                           const Gaussians& gaussians,
                                           const FeatureOptions& options, ProgressFn progress) {
  RETURN_IF_ERROR(Validate(options));
  FrozenScene scene(backend, gaussians, SceneRadius(capture));
  ASSIGN_OR_RETURN(Prepared prepared, Prepare(capture, gaussians, scene, options));
  FeatureField& field = prepared.field;
  BatchDrawer drawer(capture, field, std::move(prepared.views), options);
  BatchesAhead batches(drawer, options.num_steps, options.steps_per_chunk);
  const Buffer<int32_t> neighbors(backend, std::span<const int32_t>(prepared.neighbors));
  const NeighborGraph graph = {neighbors.span(), options.num_neighbors};
  CentroidTerm centroids(backend, capture, scene, drawer.views(), options);
  FeatureTrainer trainer(backend, gaussians.count, graph, centroids, options);
  RowChunk chunk;
  for (int step = 1; step <= options.num_steps; ++step) {
    if (chunk.Exhausted()) RETURN_IF_ERROR(chunk.Refill(batches.Next(), capture, scene, graph));
    if (centroids.Due(step - 1)) RETURN_IF_ERROR(trainer.RefreshCentroids());
    backend.Sequence(kFeatureStep + (centroids.active() ? 1 : 0),
                     [&] { trainer.Train(chunk.Next()); });
    if (step % StepsUnread(backend) != 0 && step != options.num_steps) continue;
    RETURN_IF_ERROR(TellLosses(trainer.ReadLosses(),
                               {.stage = "features",
                                .step = step,
                                .num_steps = options.num_steps,
                                .num_gaussians = gaussians.count},
                               backend, progress));
  }
  trainer.Export(field);
  return std::move(field);
}

}  // namespace pepeseg
