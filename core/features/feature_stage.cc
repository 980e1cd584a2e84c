#include "core/features/feature_stage.h"

#include <algorithm>
#include <cmath>
#include <future>
#include <span>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/features/mask_coverage.h"
#include "core/features/mask_scales.h"
#include "core/features/neighbor_graph.h"
#include "core/priors/depth_edges.h"
#include "core/status_macros.h"
#include "kernels/cpu/parallel_for.h"

namespace pepeseg {
namespace {

constexpr int kFeatureStep = 100;  // of Backend::Sequence; stage one has the small numbers

// How many steps are queued before the host waits for their losses.
int StepsUnread(const Backend& backend) { return std::max(1, 4 * backend.queue_depth()); }

bool WantsPerception(const Capture& capture, const FeatureOptions& options) {
  return options.perception_weight > 0 && HasTrainingDepth(capture);
}

std::string WhyNoPerception(const Capture& capture, const FeatureOptions& options) {
  if (options.perception_weight == 0) return "perception_weight is 0";
  if (!HasTrainingDepth(capture)) return "no training view has a depth prior";
  return "masks or the background cover all pixels away from edges";
}

std::vector<float> AllScales(const std::vector<std::vector<float>>& scales) {
  std::vector<float> all;
  for (const std::vector<float>& of_view : scales) {
    all.insert(all.end(), of_view.begin(), of_view.end());
  }
  return all;
}

}  // namespace

struct FeatureStage::Prepared {
  std::vector<DrawableView> views;
  std::vector<int32_t> neighbors;
  std::vector<float> features;  // to begin with
};

FeatureStage::FeatureStage(Backend& backend, const Capture& capture, const Gaussians& gaussians,
                           const FeatureOptions& options)
    : backend_(backend),
      capture_(capture),
      options_(options),
      num_gaussians_(gaussians.count),
      scene_(backend, gaussians, SceneRadius(capture)) {}

absl::StatusOr<std::unique_ptr<FeatureStage>> FeatureStage::Create(Backend& backend,
                                                                   const Capture& capture,
                                                                   const Gaussians& gaussians,
                                                                   const FeatureOptions& options) {
  RETURN_IF_ERROR(Validate(options));
  std::unique_ptr<FeatureStage> stage(new FeatureStage(backend, capture, gaussians, options));
  ASSIGN_OR_RETURN(Prepared prepared, stage->Prepare(gaussians));
  RETURN_IF_ERROR(stage->Begin(std::move(prepared), nullptr));
  return stage;
}

absl::StatusOr<std::unique_ptr<FeatureStage>> FeatureStage::Resume(
    Backend& backend, const Capture& capture, const Gaussians& gaussians,
    const FeatureOptions& options, const FeatureCheckpoint& checkpoint) {
  RETURN_IF_ERROR(Validate(options));
  RETURN_IF_ERROR(Validate(checkpoint));
  const FeatureCheckpoint::Counters& counters = checkpoint.counters;
  if (counters.step > options.num_steps || counters.num_gaussians != gaussians.count ||
      counters.steps_of_chunk > options.steps_per_chunk) {
    return absl::DataLossError(
        absl::StrCat("step ", counters.step, ", ", counters.steps_of_chunk, " of a chunk, on ",
                     counters.num_gaussians, " Gaussians: the training has ", options.num_steps,
                     " steps in chunks of ", options.steps_per_chunk, " on ", gaussians.count));
  }
  std::unique_ptr<FeatureStage> stage(new FeatureStage(backend, capture, gaussians, options));
  ASSIGN_OR_RETURN(Prepared prepared, stage->Prepare(gaussians));
  RETURN_IF_ERROR(stage->Begin(std::move(prepared), &checkpoint));
  return stage;
}

// A block of views at a time: their depths are rendered, then their masks measured side by side.
FeatureStage::MeasuredViews FeatureStage::MeasureViews() {
  constexpr size_t kBlock = 16;
  MeasuredViews measured = {std::vector<std::vector<float>>(capture_.views.size()),
                            std::vector<std::vector<float>>(capture_.views.size())};
  std::vector<size_t> trained;
  for (size_t i = 0; i < capture_.views.size(); ++i) {
    if (!capture_.views[i].held_out && !capture_.views[i].masks.empty()) trained.push_back(i);
  }
  const bool keep_depths = WantsPerception(capture_, options_);
  ThreadPool pool(0);
  for (size_t first = 0; first < trained.size(); first += kBlock) {
    const std::span<const size_t> block(trained.data() + first,
                                        std::min(kBlock, trained.size() - first));
    for (const size_t view : block) measured.depths[view] = scene_.Depth(capture_.views[view]);
    pool.ParallelFor(static_cast<int64_t>(block.size()), [&](int64_t i, int) {
      const size_t view = block[i];
      measured.mask_scales[view] = MaskScales(capture_.views[view], measured.depths[view]);
    });
    if (keep_depths) continue;
    for (const size_t view : block) measured.depths[view] = {};
  }
  return measured;
}

void FeatureStage::FindUncoveredPixels(std::vector<DrawableView>& views) {
  const bool with_background = options_.num_background_pixels > 0;
  if (!with_background && !WantsPerception(capture_, options_)) return;
  std::vector<UncoveredPixels> uncovered = FindUncovered(capture_, scene_);
  for (DrawableView& view : views) {
    UncoveredPixels& of_view = uncovered[view.view];
    view.unlabelled = std::move(of_view.covered_elsewhere);
    (with_background ? view.background : view.unlabelled)
        .insert(with_background ? view.background.end() : view.unlabelled.end(),
                of_view.background.begin(), of_view.background.end());
  }
}

// Of what the perception loss is, PreparePerception tells.
void FeatureStage::NoteSkipped(const std::vector<DrawableView>& views) {
  const bool has_background = std::any_of(
      views.begin(), views.end(), [](const auto& view) { return !view.background.empty(); });
  if (!has_background) {
    skipped_.push_back({"background", options_.num_background_pixels == 0
                                          ? "num_background_pixels is 0"
                                          : "masks cover all that is seen in some view"});
  }
  if (options_.centroid_weight_upper == 0 && options_.centroid_weight_lower == 0) {
    skipped_.push_back({"centroids", "both centroid weights are 0"});
  }
}

// Pixels near an edge are told nothing.
void FeatureStage::PreparePerception(std::vector<DrawableView>& views,
                                     std::span<const std::vector<float>> depths) {
  std::vector<std::vector<uint8_t>> edges(capture_.views.size());
  const bool wanted = WantsPerception(capture_, options_);
  ThreadPool pool(0);
  pool.ParallelFor(static_cast<int64_t>(views.size()), [&](int64_t i, int) {
    std::vector<int32_t>& unlabelled = views[i].unlabelled;
    const View& view = capture_.views[views[i].view];
    if (!wanted || !HasDepthPrior(view)) return unlabelled.clear();
    std::vector<uint8_t>& of_view = edges[views[i].view] = DepthEdges(view);
    std::erase_if(unlabelled, [&](int32_t p) { return of_view[p] != 0; });
  });
  const bool has_pixels = std::any_of(views.begin(), views.end(),
                                      [](const auto& view) { return !view.unlabelled.empty(); });
  if (!has_pixels) return skipped_.push_back({"perception", WhyNoPerception(capture_, options_)});
  cross_view_.emplace(capture_, views, depths);
  cues_.emplace(capture_, *cross_view_, views, std::move(edges), options_);
}

absl::StatusOr<FeatureStage::Prepared> FeatureStage::Prepare(const Gaussians& gaussians) {
  Prepared prepared;
  auto neighbors = std::async(std::launch::async, [&] {  // beside the device's work
    return NearestNeighbors(gaussians, options_.num_neighbors);
  });
  auto features = std::async(std::launch::async, [&] {
    return FeatureTrainer::InitialFeatures(num_gaussians_, options_);
  });
  const MeasuredViews measured = MeasureViews();
  const std::vector<float> all = AllScales(measured.mask_scales);
  field_.scale_quantiles =
      options_.scale_mapping == ScaleMapping::kQuantiles ? ScaleQuantiles(all) : EvenScales(all);
  prepared.views = MakeDrawableViews(capture_, measured.mask_scales);
  if (prepared.views.empty()) {
    return absl::FailedPreconditionError(
        "features: no training view has a mask of at least 8 pixels on which something is "
        "rendered");
  }
  FindUncoveredPixels(prepared.views);
  NoteSkipped(prepared.views);
  PreparePerception(prepared.views, measured.depths);
  prepared.neighbors = neighbors.get();
  prepared.features = features.get();
  return prepared;
}

absl::Status FeatureStage::Begin(Prepared prepared, const FeatureCheckpoint* checkpoint) {
  neighbors_ = Buffer<int32_t>(backend_, std::span<const int32_t>(prepared.neighbors));
  graph_ = {neighbors_.span(), options_.num_neighbors};
  drawer_.emplace(capture_, field_, std::move(prepared.views), options_);
  centroids_.emplace(backend_, capture_, scene_, drawer_->views(), options_);
  trainer_.emplace(backend_, prepared.features, graph_, *centroids_, options_);
  if (checkpoint != nullptr) RETURN_IF_ERROR(Restore(*checkpoint));
  const int num_left = options_.num_steps - (step_ - steps_of_chunk_);
  batches_.emplace(*drawer_, cues_ ? &*cues_ : nullptr, num_left, options_.steps_per_chunk);
  if (steps_of_chunk_ == 0) return absl::OkStatus();
  const int skipped = steps_of_chunk_;
  RETURN_IF_ERROR(BeginChunk());
  chunk_.Skip(skipped);
  steps_of_chunk_ = skipped;
  return absl::OkStatus();
}

absl::Status FeatureStage::Restore(const FeatureCheckpoint& checkpoint) {
  step_ = static_cast<int>(checkpoint.counters.step);
  steps_of_chunk_ = static_cast<int>(checkpoint.counters.steps_of_chunk);
  RETURN_IF_ERROR(drawer_->Restore(checkpoint.drawer));
  RETURN_IF_ERROR(centroids_->Restore(checkpoint.centroids));
  trainer_->Restore(checkpoint.rows, step_);
  return absl::OkStatus();
}

absl::Status FeatureStage::BeginChunk() {
  BatchesAhead::Chunk drawn = batches_->Next();
  chunk_start_ = std::move(drawn.before);
  steps_of_chunk_ = 0;
  return chunk_.Refill(std::move(drawn.batches), capture_, scene_, graph_);
}

absl::StatusOr<std::vector<StepReport>> FeatureStage::Advance() {
  const int end = std::min(options_.num_steps, step_ + StepsUnread(backend_));
  for (; step_ < end; ++step_, ++steps_of_chunk_) {
    if (chunk_.Exhausted()) RETURN_IF_ERROR(BeginChunk());
    if (centroids_->Due(step_)) RETURN_IF_ERROR(trainer_->RefreshCentroids());
    const RowChunk::Step step = chunk_.Next();
    const int kind = (centroids_->active() ? 1 : 0) + (step.pair_other.empty() ? 0 : 2);
    backend_.Sequence(kFeatureStep + kind, [&] { trainer_->Train(step); });
  }
  return Reports(trainer_->ReadLosses());
}

absl::StatusOr<std::vector<StepReport>> FeatureStage::Reports(
    std::span<const double> losses) const {
  std::vector<StepReport> reports;
  for (size_t i = 0; i < losses.size(); ++i) {
    const int64_t step = step_ - static_cast<int64_t>(losses.size() - 1 - i);
    if (!backend_.error().empty() || !std::isfinite(losses[i])) {
      return absl::InternalError(
          absl::StrCat("features: step ", step, ": loss ", losses[i], " ", backend_.error()));
    }
    reports.push_back({.stage = "features",
                       .step = step,
                       .num_steps = options_.num_steps,
                       .loss = losses[i],
                       .num_gaussians = num_gaussians_});
  }
  return reports;
}

absl::StatusOr<FeatureCheckpoint> FeatureStage::Save() {
  FeatureCheckpoint checkpoint;
  checkpoint.counters = {step_, steps_of_chunk_, num_gaussians_};
  // Before the first chunk nothing has been drawn that counts: the drawer begins by its seed.
  checkpoint.drawer = steps_of_chunk_ == 0 ? batches_->start() : chunk_start_;
  checkpoint.centroids = centroids_->Save();
  checkpoint.rows = trainer_->Save();
  if (const std::string error = backend_.error(); !error.empty()) return absl::InternalError(error);
  return checkpoint;
}

FeatureField FeatureStage::Export() {
  FeatureField field = field_;
  trainer_->Export(field);
  return field;
}

absl::StatusOr<FeatureField> FinishFeatures(FeatureStage& stage, ProgressFn progress) {
  while (!stage.done()) {
    ASSIGN_OR_RETURN(const std::vector<StepReport> reports, stage.Advance());
    for (const StepReport& report : reports) RETURN_IF_ERROR(progress(report));
  }
  return stage.Export();
}

}  // namespace pepeseg
