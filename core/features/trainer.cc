#include "core/features/trainer.h"

#include <algorithm>
#include <cmath>
#include <future>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"

namespace pepeseg {
namespace {

// Returns the largest number of steps that are queued before the host waits for their losses.
// At most kMaxUnreadFeatureSteps, with a queue depth of 8 on CUDA and 0 on the CPU.
int StepsUnread(const Backend& backend, int steps_at_once) {
  return std::max(steps_at_once, 4 * backend.queue_depth());
}

// Sets the confidence of Gaussians without a feature to 1. No mask ever reached them, and that they
// belong to no mask is certain: they must occlude what is behind them.
void TrustZeroFeatures(FeatureField& field) {
  for (int64_t i = 0; i < std::ssize(field.confidence); ++i) {
    if (IsZero(field.features, i)) field.confidence[i] = 1;
  }
}

// Returns DATA_LOSS where the checkpoint exceeds what the Gaussians and the options allow.
absl::Status CheckMatches(const FeatureCheckpoint& checkpoint, const Gaussians& gaussians,
                          const FeatureOptions& options) {
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
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<std::unique_ptr<FeatureTrainer>> FeatureTrainer::Create(
    Backend& backend, const Capture& capture, const Gaussians& gaussians,
    const FeatureOptions& options) {
  RETURN_IF_ERROR(Validate(options));
  // Takes a while and uses no device: runs while the device renders.
  auto initial =
      std::async(std::launch::async, [&] { return InitialFeatures(gaussians.count, options); });
  ASSIGN_OR_RETURN(PreparedFeatures prepared,
                   PrepareFeatures(backend, capture, gaussians, options));
  return std::unique_ptr<FeatureTrainer>(
      new FeatureTrainer(backend, std::move(prepared), initial.get(), options));
}

absl::StatusOr<std::unique_ptr<FeatureTrainer>> FeatureTrainer::Resume(
    Backend& backend, const Capture& capture, const Gaussians& gaussians,
    const FeatureOptions& options, const FeatureCheckpoint& checkpoint) {
  RETURN_IF_ERROR(Validate(options));
  RETURN_IF_ERROR(Validate(checkpoint));
  RETURN_IF_ERROR(CheckMatches(checkpoint, gaussians, options));
  ASSIGN_OR_RETURN(std::unique_ptr<FeatureTrainer> trainer,
                   Create(backend, capture, gaussians, options));
  RETURN_IF_ERROR(trainer->Restore(checkpoint));
  return trainer;
}

FeatureTrainer::FeatureTrainer(Backend& backend, PreparedFeatures prepared,
                               std::span<const float> initial, const FeatureOptions& options)
    : backend_(backend),
      options_(options),
      prepared_(std::move(prepared)),
      optimizer_(backend, prepared_, initial, options),
      batches_(prepared_, options, backend.MakeTwin(QueuePriority::kSame)),
      skipped_(prepared_.skipped),
      window_(Convergence::Window(static_cast<int>(prepared_.views.size()))),
      losses_(options.min_loss_fall) {}

absl::Status FeatureTrainer::Restore(const FeatureCheckpoint& checkpoint) {
  const FeatureCheckpoint::Counters& counters = checkpoint.counters;
  step_ = static_cast<int>(counters.step);
  // The batches continue from the start of the chunk, everything else from the last step done.
  RETURN_IF_ERROR(
      batches_.Restore(checkpoint.drawer, step_, static_cast<int>(counters.steps_of_chunk)));
  RETURN_IF_ERROR(optimizer_.Restore(checkpoint.rows, checkpoint.centroids, step_));
  LeaveOut({static_cast<int>(counters.left_out_after), static_cast<int>(counters.num_left_out)});
  losses_.Restore({checkpoint.losses[0], checkpoint.losses[1], checkpoint.losses[2]});
  return absl::OkStatus();
}

// Never steps over the end of a window, so that the losses can be reviewed there.
int FeatureTrainer::StepsAhead() const {
  return std::min({num_steps() - step_, StepsUnread(backend_, optimizer_.steps_at_once()),
                   window_ - step_ % window_});
}

// Nothing but updates changes features between steps that are done at once.
int FeatureTrainer::StepsAtOnce(int end) const {
  int num = 1;
  while (num < optimizer_.steps_at_once() && step_ + num < end &&
         step_ + num != NumSmoothedSteps(options_) &&
         !optimizer_.CentroidsAreDue(step_ + num + left_out_.num)) {
    ++num;
  }
  return num;
}

absl::StatusOr<StepReports> FeatureTrainer::Step() {
  const int end = step_ + StepsAhead();
  while (step_ < end) {
    ASSIGN_OR_RETURN(const std::vector<RowChunk::Step> steps, batches_.Next(StepsAtOnce(end)));
    if (step_ == NumSmoothedSteps(options_)) optimizer_.EndSmoothing();
    // Skipped steps count as done, so that the last share of the schedule has the centroid loss.
    RETURN_IF_ERROR(optimizer_.RefreshCentroids(step_ + left_out_.num));
    optimizer_.Train(steps);
    step_ += static_cast<int>(steps.size());
  }
  const std::vector<double> losses = optimizer_.ReadLosses();
  ReviewLosses(losses);
  return Reports(losses);
}

// At the end of a window in which the losses have not fallen enough, all steps are left out except
// closing_share of the schedule, in which the learning rate falls to its end. Windows that begin
// while fine masks go first are not compared, because their losses are of other scales.
void FeatureTrainer::ReviewLosses(std::span<const double> losses) {
  for (const double loss : losses) losses_.Add(loss);
  if (step_ % window_ != 0) return;
  if (step_ - window_ < options_.fine_first * options_.num_steps) return losses_.Restore({});
  if (!losses_.StoppedFalling()) return;
  const long closing = std::lround(options_.closing_share * options_.num_steps);
  const int num_saved = num_steps() - step_ - static_cast<int>(closing);
  if (num_saved <= 0) return;
  LeaveOut({step_, num_saved});
  skipped_.push_back(
      {Part::kSteps,
       absl::StrCat("the loss has stopped falling: ", closing, " steps close the schedule"), step_,
       num_saved});
}

void FeatureTrainer::LeaveOut(const LeftOutSteps& steps) {
  left_out_ = steps;
  if (steps.num == 0) return;
  optimizer_.LeaveOut(steps);
  batches_.LeaveOutLast(steps.num);
}

absl::StatusOr<StepReports> FeatureTrainer::Reports(std::span<const double> losses) const {
  StepReports reports;
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
                       .num_gaussians = optimizer_.num_gaussians()});
  }
  return reports;
}

absl::StatusOr<FeatureCheckpoint> FeatureTrainer::Save() {
  FeatureCheckpoint checkpoint;
  checkpoint.counters = {step_, batches_.steps_of_chunk(), optimizer_.num_gaussians(),
                         left_out_.num, left_out_.num_done};
  checkpoint.losses = {losses_.state().sum, losses_.state().num, losses_.state().before};
  checkpoint.drawer = batches_.chunk_start();
  checkpoint.centroids = optimizer_.SaveCentroids();
  checkpoint.rows = optimizer_.Save();
  if (const std::string error = backend_.error(); !error.empty()) return absl::InternalError(error);
  return checkpoint;
}

FeatureField FeatureTrainer::Result() {
  FeatureField field = prepared_.field;
  optimizer_.Export(field);
  TrustZeroFeatures(field);
  return field;
}

FeatureField FeatureTrainer::Snapshot() {
  FeatureField field = prepared_.field;
  optimizer_.ExportUnchanged(field);
  TrustZeroFeatures(field);
  return field;
}

}  // namespace pepeseg
