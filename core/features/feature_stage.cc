#include "core/features/feature_stage.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"

namespace pepeseg {
namespace {

constexpr int kFeatureStep = 200;  // first id for Backend::Sequence; stage one has smaller ones

// Returns the largest number of steps that are queued before the host waits for their losses.
// At most kMaxUnreadFeatureSteps, with a queue depth of 8 on CUDA and 0 on the CPU.
int StepsUnread(const Backend& backend) { return std::max(1, 4 * backend.queue_depth()); }

// Sets the confidence of Gaussians without a feature to 1. No mask ever reached them, and that they
// belong to no mask is certain: they must occlude what is behind them.
void TrustZeroFeatures(FeatureField& field) {
  for (int64_t i = 0; i < std::ssize(field.confidence); ++i) {
    if (IsZero(field.features, i)) field.confidence[i] = 1;
  }
}

}  // namespace

FeatureStage::FeatureStage(Backend& backend, const Capture& capture, const Gaussians& gaussians,
                           const FeatureOptions& options)
    : backend_(backend),
      capture_(capture),
      options_(options),
      num_gaussians_(gaussians.count),
      scene_(backend, gaussians, SceneRadius(capture)),
      losses_(options.min_loss_fall) {}

absl::StatusOr<std::unique_ptr<FeatureStage>> FeatureStage::Create(Backend& backend,
                                                                   const Capture& capture,
                                                                   const Gaussians& gaussians,
                                                                   const FeatureOptions& options) {
  RETURN_IF_ERROR(Validate(options));
  std::unique_ptr<FeatureStage> stage(new FeatureStage(backend, capture, gaussians, options));
  ASSIGN_OR_RETURN(PreparedFeatures prepared,
                   PrepareFeatures(capture, gaussians, stage->scene_, options));
  RETURN_IF_ERROR(stage->Begin(std::move(prepared), nullptr));
  return stage;
}

absl::StatusOr<std::unique_ptr<FeatureStage>> FeatureStage::Resume(
    Backend& backend, const Capture& capture, const Gaussians& gaussians,
    const FeatureOptions& options, const FeatureCheckpoint& checkpoint) {
  RETURN_IF_ERROR(Validate(options));
  RETURN_IF_ERROR(Validate(checkpoint));
  const FeatureCheckpoint::Counters& counters = checkpoint.counters;
  if (counters.step + counters.num_left_out > options.num_steps ||
      counters.num_gaussians != gaussians.count ||
      counters.steps_of_chunk > options.steps_per_chunk) {
    return absl::DataLossError(absl::StrCat(
        "checkpoint after step ", counters.step, " (", counters.steps_of_chunk, " of its chunk; ",
        counters.num_left_out, " steps left out) with ", counters.num_gaussians,
        " Gaussians does not fit the training, which has ", options.num_steps,
        " steps in chunks of ", options.steps_per_chunk, " and ", gaussians.count, " Gaussians"));
  }
  if (checkpoint.rows.gate.size() != static_cast<size_t>(NumGateNumbers(options))) {
    return absl::DataLossError(absl::StrCat(
        "checkpoint: the gate has ", checkpoint.rows.gate.size(), " numbers, with gate_layers ",
        options.gate_layers, " it has ", NumGateNumbers(options)));
  }
  std::unique_ptr<FeatureStage> stage(new FeatureStage(backend, capture, gaussians, options));
  ASSIGN_OR_RETURN(PreparedFeatures prepared,
                   PrepareFeatures(capture, gaussians, stage->scene_, options));
  RETURN_IF_ERROR(stage->Begin(std::move(prepared), &checkpoint));
  return stage;
}

absl::Status FeatureStage::Begin(PreparedFeatures prepared, const FeatureCheckpoint* checkpoint) {
  skipped_ = std::move(prepared.skipped);
  field_.scale_quantiles = std::move(prepared.scale_quantiles);
  field_.confidence = std::move(prepared.confidence);
  mask_quality_ = prepared.mask_quality;
  completed_masks_ = std::move(prepared.completed_masks);
  reprojection_ = std::move(prepared.reprojection);
  cross_view_ = std::move(prepared.cross_view);
  cues_ = std::move(prepared.cues);
  neighbors_ = Buffer<int32_t>(backend_, std::span<const int32_t>(prepared.neighbors));
  graph_ = {neighbors_.span(), options_.num_neighbors};
  // Members that follow refer to those before: the drawer to field_, the centroids to the drawer's
  // views, the trainer to the graph and the centroids.
  drawer_.emplace(field_, std::move(prepared.views), options_);
  window_ = Convergence::Window(static_cast<int>(drawer_->views().size()));
  centroids_.emplace(backend_, capture_, scene_, drawer_->views(), options_);
  trainer_.emplace(backend_, prepared.features, graph_, *centroids_, options_);
  if (checkpoint != nullptr) RETURN_IF_ERROR(Restore(*checkpoint));
  // A checkpoint within a chunk has the drawer's state before the chunk. The whole chunk is drawn
  // and rasterised again, and the steps that are already done are skipped.
  const int num_left = num_steps() - (step_ - steps_of_chunk_);
  batches_.emplace(*drawer_, cues_.get(), num_left, options_.steps_per_chunk);
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
  // The drawer continues from the start of the chunk, everything else from the last step done.
  RETURN_IF_ERROR(drawer_->Restore(checkpoint.drawer, step_ - steps_of_chunk_));
  RETURN_IF_ERROR(centroids_->Restore(checkpoint.centroids));
  trainer_->Restore(checkpoint.rows, step_);
  num_left_out_ = static_cast<int>(checkpoint.counters.num_left_out);
  left_out_after_ = static_cast<int>(checkpoint.counters.left_out_after);
  if (num_left_out_ > 0) trainer_->LeaveOut(left_out_after_, num_left_out_);
  losses_.Restore({checkpoint.losses[0], checkpoint.losses[1], checkpoint.losses[2]});
  return absl::OkStatus();
}

absl::Status FeatureStage::BeginChunk() {
  BatchesAhead::Chunk drawn = batches_->Next();
  chunk_start_ = std::move(drawn.before);
  steps_of_chunk_ = 0;
  return chunk_.Refill(std::move(drawn.batches), capture_, scene_, graph_);
}

// Never steps over the end of a window, so that the losses can be reviewed there.
int FeatureStage::StepsAhead() const {
  return std::min({num_steps() - step_, StepsUnread(backend_), window_ - step_ % window_});
}

absl::StatusOr<std::vector<StepReport>> FeatureStage::Advance() {
  const int end = step_ + StepsAhead();
  for (; step_ < end; ++step_, ++steps_of_chunk_) {
    if (chunk_.Exhausted()) RETURN_IF_ERROR(BeginChunk());
    if (step_ == NumSmoothedSteps(options_)) trainer_->EndSmoothing();
    // Skipped steps count as done, so that the last share of the schedule has the centroid loss.
    if (centroids_->Due(step_ + num_left_out_)) RETURN_IF_ERROR(trainer_->RefreshCentroids());
    const RowChunk::Step step = chunk_.Next();
    // A step runs the same ops as the last one of its kind, whose graph a backend may reuse.
    const int kind = (centroids_->active() ? 1 : 0) + (step.pair_other.empty() ? 0 : 2);
    backend_.Sequence(kFeatureStep + kind, [&] { trainer_->Train(step); });
  }
  const std::vector<double> losses = trainer_->ReadLosses();
  ReviewLosses(losses);
  return Reports(losses);
}

// At the end of a window in which the losses have not fallen enough, all steps are left out except
// closing_share of the schedule, in which the learning rate falls to its end. Windows that begin
// while fine masks go first are not compared, because their losses are of other scales.
void FeatureStage::ReviewLosses(std::span<const double> losses) {
  for (const double loss : losses) losses_.Add(loss);
  if (step_ % window_ != 0) return;
  if (step_ - window_ < options_.fine_first * options_.num_steps) return losses_.Restore({});
  if (!losses_.StoppedFalling()) return;
  const long closing = std::lround(options_.closing_share * options_.num_steps);
  const int num_saved = num_steps() - step_ - static_cast<int>(closing);
  if (num_saved <= 0) return;
  num_left_out_ = num_saved;
  left_out_after_ = step_;
  trainer_->LeaveOut(left_out_after_, num_left_out_);
  batches_->Skip(num_saved);
  skipped_.push_back(
      {Part::kSteps,
       absl::StrCat("the loss has stopped falling: ", closing, " steps close the schedule"), step_,
       num_saved});
}

absl::StatusOr<std::vector<StepReport>> FeatureStage::Reports(
    std::span<const double> losses) const {
  std::vector<StepReport> reports;
  for (size_t i = 0; i < losses.size(); ++i) {
    // step_ has counted all steps of this call: the last loss belongs to step_, counted from 1.
    const int64_t step = step_ - static_cast<int64_t>(losses.size() - 1 - i);
    if (!backend_.error().empty() || !std::isfinite(losses[i])) {
      return absl::InternalError(
          absl::StrCat("features: step ", step, ": loss ", losses[i], " ", backend_.error()));
    }
    reports.push_back({.step = step,
                       .num_steps = num_steps(),
                       .loss = losses[i],
                       .num_gaussians = num_gaussians_});
  }
  return reports;
}

absl::StatusOr<FeatureCheckpoint> FeatureStage::Save() {
  FeatureCheckpoint checkpoint;
  checkpoint.counters = {step_, steps_of_chunk_, num_gaussians_, num_left_out_, left_out_after_};
  checkpoint.losses = {losses_.state().sum, losses_.state().num, losses_.state().before};
  // Before the first chunk chunk_start_ is not set. Later a chunk always has at least one step
  // done.
  checkpoint.drawer = steps_of_chunk_ == 0 ? batches_->start() : chunk_start_;
  checkpoint.centroids = centroids_->Save();
  checkpoint.rows = trainer_->Save();
  if (const std::string error = backend_.error(); !error.empty()) return absl::InternalError(error);
  return checkpoint;
}

FeatureField FeatureStage::Export() {
  FeatureField field = field_;
  trainer_->Export(field);
  TrustZeroFeatures(field);
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
