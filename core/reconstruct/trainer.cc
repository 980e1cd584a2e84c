#include "core/reconstruct/trainer.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "core/base/random_state.h"
#include "core/base/status_macros.h"
#include "core/render/image_of_planes.h"

namespace pepeseg {
namespace {

constexpr float kResetOpacity = 0.01f;  // upper limit of all opacities after a reset (3DGS)

// Returns the share of the rounds that each training view is in.
std::vector<double> RoundShares(int num_views, const std::vector<bool>& blurred, double share) {
  std::vector<double> shares(static_cast<size_t>(num_views), 1);
  for (size_t view = 0; view < blurred.size(); ++view) {
    if (blurred[view]) shares[view] = share;
  }
  return shares;
}

}  // namespace

absl::StatusOr<std::unique_ptr<GaussianTrainer>> GaussianTrainer::Create(
    Backend& backend, const Capture& capture, const ReconstructOptions& options) {
  RETURN_IF_ERROR(Validate(options));
  RETURN_IF_ERROR(CheckTrainable(capture));
  std::unique_ptr<GaussianTrainer> trainer(new GaussianTrainer(backend, capture, options));
  RETURN_IF_ERROR(trainer->CheckAllocated());
  return trainer;
}

// An allocation that fails leaves an empty buffer, which CheckAllocated() reports.
GaussianTrainer::GaussianTrainer(Backend& backend, const Capture& capture,
                                 const ReconstructOptions& options)
    : backend_(backend),
      random_(options.seed),
      scene_(backend, capture, options, random_),
      skipped_(scene_.skipped),
      sampler_(RoundShares(scene_.views.size(), scene_.blurred, options.blurred_share)),
      refiner_(backend, capture, scene_.options, scene_.schedule, scene_.place),
      state_(backend, InitialGaussians(scene_.points, options.sh_degree, scene_.log_scales)),
      densifier_(backend, scene_.options,
                 {scene_.radius, scene_.views.num_pixels(), state_.count()}),
      depth_term_(backend, scene_.options, scene_.views.max_pixels()),
      queue_(backend, scene_, depth_term_, state_),
      needs_(scene_.options, scene_.views.size()),
      tally_(options.ssim_weight) {}

absl::Status GaussianTrainer::CheckAllocated() const {
  if (scene_.views.allocated() && refiner_.allocated() && state_.allocated() &&
      depth_term_.allocated() && queue_.allocated()) {
    return absl::OkStatus();
  }
  return absl::ResourceExhaustedError(absl::StrCat("out of memory for ", scene_.views.size(),
                                                   " views and ", state_.count(), " Gaussians"));
}

absl::StatusOr<std::unique_ptr<GaussianTrainer>> GaussianTrainer::Resume(
    Backend& backend, const Capture& capture, const ReconstructOptions& options,
    const GaussianCheckpoint& checkpoint) {
  RETURN_IF_ERROR(Validate(checkpoint));
  ASSIGN_OR_RETURN(std::unique_ptr<GaussianTrainer> trainer, Create(backend, capture, options));
  RETURN_IF_ERROR(trainer->CheckMatches(checkpoint));
  RETURN_IF_ERROR(trainer->Restore(checkpoint));
  return trainer;
}

// Returns DATA_LOSS where the checkpoint exceeds what the options and the capture allow.
absl::Status GaussianTrainer::CheckMatches(const GaussianCheckpoint& checkpoint) const {
  if (checkpoint.counters.step > scene_.options.num_steps) {
    return absl::DataLossError(absl::StrCat("step ", checkpoint.counters.step,
                                            " exceeds the num_steps of the options, ",
                                            scene_.options.num_steps));
  }
  if (checkpoint.counters.position > scene_.options.num_steps) {
    return absl::DataLossError(absl::StrCat("schedule position ", checkpoint.counters.position,
                                            " exceeds the num_steps of the options, ",
                                            scene_.options.num_steps));
  }
  // Smaller is valid: degrees may have been pruned.
  if (checkpoint.gaussians.shape.sh_degree > scene_.options.sh_degree) {
    return absl::DataLossError(absl::StrCat("SH degree ", checkpoint.gaussians.shape.sh_degree,
                                            " exceeds the sh_degree of the options, ",
                                            scene_.options.sh_degree));
  }
  // views_left indexes the training views unchecked; each is in a round once.
  std::vector<bool> seen(static_cast<size_t>(scene_.views.size()), false);
  for (const int32_t view : checkpoint.views_left) {
    if (view < 0 || view >= scene_.views.size() || seen[view]) {
      return absl::DataLossError(absl::StrCat("views_left: view ", view,
                                              " is out of range or listed twice; there are ",
                                              scene_.views.size(), " training views"));
    }
    seen[view] = true;
  }
  return absl::OkStatus();
}

absl::Status GaussianTrainer::Restore(const GaussianCheckpoint& checkpoint) {
  // Create has drawn from random_ for the starting points; the saved state replaces what it left.
  RETURN_IF_ERROR(SetState(checkpoint.random, random_));
  sampler_.Restore({checkpoint.views_left.begin(), checkpoint.views_left.end()});
  step_ = static_cast<int>(checkpoint.counters.step);
  position_ = static_cast<int>(checkpoint.counters.position);
  if (checkpoint.counters.depth_is_left_out != 0) depth_term_.LeaveOut();
  needs_.Restore(checkpoint.needs);
  const GaussianCheckpoint::Counters& counters = checkpoint.counters;
  tally_.Restore({counters.num_culled_degenerate, counters.num_skipped_gradients,
                  counters.num_overflowed_renders, counters.num_skipped_depths});
  refiner_.Restore({counters.num_refined, counters.num_refine_split});
  if (state_.Restore(checkpoint.gaussians)) return absl::OkStatus();
  return absl::ResourceExhaustedError(
      absl::StrCat("out of memory for ", checkpoint.gaussians.shape.count, " Gaussians"));
}

absl::StatusOr<GaussianCheckpoint> GaussianTrainer::Save() {
  ReadAll();
  // Queued steps are done first: the rows, the counters and the losses must belong to the same
  // step.
  GaussianCheckpoint checkpoint;
  const StepTally::Totals& totals = tally_.totals();
  checkpoint.counters = {step_,
                         totals.num_culled_degenerate,
                         totals.num_skipped_gradients,
                         totals.num_overflowed_renders,
                         refiner_.counts().num_refined,
                         refiner_.counts().num_split,
                         totals.num_skipped_depths,
                         position_,
                         depth_term_.left_out() ? 1 : 0};
  checkpoint.needs = needs_.Save();
  checkpoint.random = StateOf(random_);
  checkpoint.views_left.assign(sampler_.left().begin(), sampler_.left().end());
  checkpoint.gaussians = state_.DownloadRows();
  // After a device error the downloads are not the state.
  if (const std::string error = backend_.error(); !error.empty()) {
    return absl::InternalError(absl::StrCat("after step ", step_, ": ", error));
  }
  return checkpoint;
}

// The memory of the render is its own and is freed at the end: a scratch of the queue belongs to
// steps that the backend may replay.
absl::StatusOr<Image> GaussianTrainer::Render(const PinholeView& view) {
  // Errors of queued steps stay; only one of the render below is cleared.
  backend_.Sync();
  if (const std::string error = backend_.error(); !error.empty()) {
    return absl::InternalError(absl::StrCat("step ", step_, ": ", error));
  }
  std::vector<float> planes(static_cast<size_t>(3) * view.width * view.height);
  RenderScratch scratch;
  Buffer<float> color(backend_, static_cast<int64_t>(planes.size()));
  backend_.Render(
      {.gaussians = state_.parameters(),
       .view = view,
       .near_plane = scene_.near_plane,
       .active_sh_degree = std::min(scene_.schedule.ShDegreeAt(position_), state_.sh_degree()),
       .scratch = &scratch,
       .color = color.span(),
       .for_backward = false});
  if (!color.empty()) color.Download(std::span<float>(planes));
  const BackendError error = backend_.TakeError();
  if (error.fatal) return absl::InternalError(absl::StrCat("picture: ", error.what));
  if (!error.what.empty()) return absl::ResourceExhaustedError(error.what);
  return ImageOfPlanes(view.width, view.height, planes);
}

// Steps of METHOD.md section 1: train on a view each, then density control, opacity reset and
// refinement where they are due after the last of them.
absl::StatusOr<StepReports> GaussianTrainer::Step() {
  std::vector<StepInput> steps;
  const int end = EndOfSteps();
  for (int position = position_; position < end; ++position) steps.push_back(DrawStep(position));
  queue_.Train(steps);
  while (queue_.full()) ReadOldest();

  const int last = end - 1;
  const bool densify = densifier_.Due(last);
  // The rest changes the Gaussians or reads the losses: all steps must have been done, those
  // whose render overflowed repeated, on the Gaussians that they were queued for.
  if (ChangesGaussiansAfter(last)) ReadAll();
  if (densify) {
    const bool has_depth = depth_term_.InEffect(scene_.schedule.DepthWeightAt(last));
    // Draws the seed of the round, after the draws of the steps.
    RETURN_IF_ERROR(densifier_.Apply(last, has_depth, state_, random_));
  }
  if (densify || end == scene_.options.num_steps) RETURN_IF_ERROR(ClearFreeSpace());
  if (densifier_.OpacityResetDue(last)) state_.LimitOpacity(kResetOpacity);
  if (!densify && refiner_.Due(last)) RETURN_IF_ERROR(Refine(steps.back()));
  refiner_.EndStep(last, state_);
  step_ += end - position_;
  position_ = end;
  if (needs_.EndsWindow(last)) DropUnneededParts();
  return Report();
}

// Returns whether the Gaussians, or what is trained, may change otherwise than by updates after the
// step at this position.
bool GaussianTrainer::ChangesGaussiansAfter(int position) const {
  return densifier_.Due(position) || densifier_.OpacityResetDue(position) ||
         refiner_.Due(position) || needs_.EndsWindow(position) ||
         position + 1 == scene_.options.num_steps;
}

// Returns the position behind the steps that are done at once from position_ on.
int GaussianTrainer::EndOfSteps() const {
  const int shrink = scene_.schedule.ShrinkAt(position_);
  const int most = queue_.steps_at_once(shrink);
  int end = position_ + 1;
  while (end - position_ < most && !ChangesGaussiansAfter(end - 1) &&
         scene_.schedule.ShrinkAt(end) == shrink) {
    ++end;
  }
  return end;
}

// The draws of a step are in a fixed order: the view, then the depth patch.
StepInput GaussianTrainer::DrawStep(int position) {
  StepInput input;
  input.position = position;
  input.view = sampler_.Next(random_);
  input.shrink = scene_.schedule.ShrinkAt(position);
  input.num_gaussians = state_.count();
  input.dropout = DropoutOf(step_ + position - position_, position);
  input.depth = depth_term_.PlanFor(scene_.views.At(input.view, input.shrink),
                                    scene_.schedule.DepthWeightAt(position), random_);
  return input;
}

// Reads the result of the oldest queued step; waits for it. A step whose render overflowed is
// queued again and read later.
void GaussianTrainer::ReadOldest() {
  const std::optional<StepResult> popped = queue_.Pop();
  if (!popped) return tally_.RecordOverflow();
  tally_.Record(*popped);
  needs_.RecordLoss(tally_.LossOf(*popped));
  if (popped->input.depth.weight > 0) needs_.RecordDepth(DepthExplained(*popped));
}

void GaussianTrainer::ReadAll() {
  while (!queue_.empty()) ReadOldest();
}

// Returns the share of the prior's spread that the fit to the whole view explains: 1 minus mean
// residual over mean deviation. 0 where the view carries no fit.
double GaussianTrainer::DepthExplained(const StepResult& result) const {
  const double* sums = result.loss_sums.data() + kFirstDepthSum;
  const double spread = scene_.views.At(result.input.view, result.input.shrink).prior_deviation;
  if (sums[kDepthSkipped] > 0 || spread <= 0) return 0;
  return 1 - sums[kSumDepthView] / (double{result.input.depth.weight} * spread);
}

// Carries out what SceneNeeds decides at the end of a window (METHOD.md section 1, "What a scene
// does not need"). Ending the stage early moves the schedule position to the start of the last
// closing_share.
void GaussianTrainer::DropUnneededParts() {
  const SceneNeeds::Decision decision = needs_.Decide(position_ - 1);
  if (decision.leave_out_depth && !depth_term_.left_out()) {
    depth_term_.LeaveOut();
    skipped_.push_back({Part::kDepth,
                        "the depth priors do not agree with the depth of what the photographs show",
                        step_});
  }
  if (decision.prune_sh_degree) {
    const int earned = SufficientShDegree(backend_, scene_.views, scene_.near_plane, state_,
                                          scene_.options.min_band_gain);
    if (earned < state_.sh_degree()) {
      skipped_.push_back({Part::kBands,
                          absl::StrCat("spherical harmonics of degrees over ", earned,
                                       " gain less than ", scene_.options.min_band_gain, " dB"),
                          step_});
      state_.LimitShDegree(earned);
    }
  }
  if (decision.close) {
    const auto closing =
        static_cast<int>(std::lround(scene_.options.closing_share * scene_.options.num_steps));
    const int saved = scene_.options.num_steps - closing - position_;
    skipped_.push_back({Part::kSteps,
                        absl::StrCat("the loss of the training views has stopped falling: ",
                                     closing, " steps close the schedule"),
                        step_, saved});
    position_ += saved;
  }
}

// Returns the dropout of a step. Its seed depends on nothing that a checkpoint would have to hold.
Dropout GaussianTrainer::DropoutOf(int step, int position) const {
  if (position >= scene_.options.dropout_until * scene_.options.num_steps) return {};
  constexpr uint64_t kMix = 0x9e3779b97f4a7c15;
  const uint64_t seed = (scene_.options.seed * kMix + static_cast<uint64_t>(step)) * kMix;
  return {scene_.options.dropout, static_cast<uint32_t>(seed >> 32)};
}

absl::Status GaussianTrainer::Refine(const StepInput& input) {
  return refiner_.Apply(
      {input.view, scene_.views.At(input.view, input.shrink).pinhole, scene_.near_plane}, state_);
}

// After each round of density control, so that it cannot fill the free space again, and at the end.
absl::Status GaussianTrainer::ClearFreeSpace() {
  if (scene_.free_space.empty()) return absl::OkStatus();
  const int64_t num_removed = state_.Remove(
      [this](const Eigen::Vector3f& mean) { return scene_.free_space.Contains(mean); });
  if (num_removed >= 0) return absl::OkStatus();
  return absl::ResourceExhaustedError(
      absl::StrCat("out of memory for ", state_.count(), " Gaussians"));
}

// Reports the state after a step. The number of steps shrinks when steps are skipped.
absl::StatusOr<StepReports> GaussianTrainer::Report() const {
  if (const std::string error = backend_.error(); !error.empty()) {
    return absl::InternalError(absl::StrCat("step ", step_, ": ", error));
  }
  const ReconstructOptions& options = scene_.options;
  if (state_.count() > options.max_gaussians) {
    return absl::InternalError(absl::StrCat("step ", step_, ": ", state_.count(),
                                            " Gaussians exceed max_gaussians, ",
                                            options.max_gaussians));
  }
  StepReport report;
  report.step = step_;
  report.num_steps = step_ + options.num_steps - position_;
  report.num_gaussians = state_.count();
  report.num_refined = refiner_.counts().num_refined;
  report.num_refine_split = refiner_.counts().num_split;
  tally_.Describe(report);
  return StepReports{report};
}

}  // namespace pepeseg
