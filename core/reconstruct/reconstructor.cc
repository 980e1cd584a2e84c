#include "core/reconstruct/reconstructor.h"

#include <algorithm>
#include <cmath>
#include <sstream>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/reconstruct/blurred_views.h"
#include "core/reconstruct/pixel_budget.h"

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

absl::StatusOr<std::unique_ptr<Reconstructor>> Reconstructor::Create(
    Backend& backend, const Capture& capture, const ReconstructOptions& options) {
  RETURN_IF_ERROR(Validate(options));
  RETURN_IF_ERROR(CheckTrainable(capture));
  std::unique_ptr<Reconstructor> reconstructor(new Reconstructor(backend, capture, options));
  RETURN_IF_ERROR(reconstructor->Allocated());
  return reconstructor;
}

// Members are built in the order of their declaration: the schedule needs the points, and the
// Gaussians need the bounds of their sizes. An allocation that fails leaves an empty buffer, which
// Allocated() reports.
Reconstructor::Reconstructor(Backend& backend, const Capture& capture,
                             const ReconstructOptions& options)
    : backend_(backend),
      options_(WithPixelBudget(WithDepthWeight(options, capture), capture)),
      skipped_(SkippedParts(options, capture)),
      scene_radius_(SceneRadius(capture)),
      random_(options.seed),
      points_(StartingPoints(capture, options_, random_)),
      schedule_(options_, scene_radius_, PixelSpan(capture, points_)),
      refiner_(backend, capture, options_, schedule_),
      views_(backend, capture,
             {options_.coarse_until > 0, options_.depth_weight > 0,
              options.disparity_as_inverse_depth}),
      blurred_(options.blurred_share < 1 ? FindBlurred(capture) : std::vector<bool>()),
      sampler_(RoundShares(views_.size(), blurred_, options.blurred_share)),
      log_scales_(BoundLogScales(capture, points_)),
      free_space_(capture, options.camera_clearance),
      state_(backend, InitialGaussians(points_, options.sh_degree, log_scales_)),
      densifier_(backend, options_, {scene_radius_, views_.num_pixels(), state_.count()}),
      depth_term_(backend, options_, views_.max_pixels()),
      queue_(backend, {options_, views_, schedule_, log_scales_, NearPlane()}, depth_term_, state_),
      needs_(options_, views_.size()) {}

absl::Status Reconstructor::Allocated() const {
  if (views_.allocated() && refiner_.allocated() && state_.allocated() && depth_term_.allocated() &&
      queue_.allocated()) {
    return absl::OkStatus();
  }
  return absl::ResourceExhaustedError(absl::StrCat("out of memory for ", views_.size(),
                                                   " views and ", state_.count(), " Gaussians"));
}

absl::StatusOr<std::unique_ptr<Reconstructor>> Reconstructor::Resume(
    Backend& backend, const Capture& capture, const ReconstructOptions& options,
    const ReconstructCheckpoint& checkpoint) {
  RETURN_IF_ERROR(Validate(checkpoint));
  ASSIGN_OR_RETURN(std::unique_ptr<Reconstructor> reconstructor, Create(backend, capture, options));
  RETURN_IF_ERROR(reconstructor->CheckMatches(checkpoint));
  RETURN_IF_ERROR(reconstructor->Restore(checkpoint));
  return reconstructor;
}

// Returns DATA_LOSS where the checkpoint exceeds what the options and the capture allow.
absl::Status Reconstructor::CheckMatches(const ReconstructCheckpoint& checkpoint) const {
  if (checkpoint.counters.step > options_.num_steps) {
    return absl::DataLossError(absl::StrCat("step ", checkpoint.counters.step,
                                            " exceeds the num_steps of the options, ",
                                            options_.num_steps));
  }
  if (checkpoint.counters.position > options_.num_steps) {
    return absl::DataLossError(absl::StrCat("schedule position ", checkpoint.counters.position,
                                            " exceeds the num_steps of the options, ",
                                            options_.num_steps));
  }
  // Smaller is valid: degrees may have been pruned.
  if (checkpoint.gaussians.shape.sh_degree > options_.sh_degree) {
    return absl::DataLossError(absl::StrCat("SH degree ", checkpoint.gaussians.shape.sh_degree,
                                            " exceeds the sh_degree of the options, ",
                                            options_.sh_degree));
  }
  // views_left indexes the training views unchecked; each is in a round once.
  std::vector<bool> seen(static_cast<size_t>(views_.size()), false);
  for (const int32_t view : checkpoint.views_left) {
    if (view < 0 || view >= views_.size() || seen[view]) {
      return absl::DataLossError(absl::StrCat("views_left: view ", view,
                                              " is out of range or listed twice; there are ",
                                              views_.size(), " training views"));
    }
    seen[view] = true;
  }
  return absl::OkStatus();
}

absl::Status Reconstructor::Restore(const ReconstructCheckpoint& checkpoint) {
  // Create has drawn from random_ for the starting points; the saved state replaces what it left.
  std::istringstream random(checkpoint.random);
  random >> random_;
  if (random.fail()) return absl::DataLossError("the random engine's state cannot be parsed");
  sampler_.Restore({checkpoint.views_left.begin(), checkpoint.views_left.end()});
  step_ = static_cast<int>(checkpoint.counters.step);
  position_ = static_cast<int>(checkpoint.counters.position);
  if (checkpoint.counters.depth_is_left_out != 0) depth_term_.LeaveOut();
  needs_.Restore(checkpoint.needs);
  num_culled_degenerate_ = checkpoint.counters.num_culled_degenerate;
  num_skipped_gradients_ = checkpoint.counters.num_skipped_gradients;
  num_overflowed_renders_ = checkpoint.counters.num_overflowed_renders;
  refiner_.Restore({checkpoint.counters.num_refined, checkpoint.counters.num_refine_split});
  num_skipped_depths_ = checkpoint.counters.num_skipped_depths;
  if (state_.Restore(checkpoint.gaussians)) return absl::OkStatus();
  return absl::ResourceExhaustedError(
      absl::StrCat("out of memory for ", checkpoint.gaussians.shape.count, " Gaussians"));
}

absl::StatusOr<ReconstructCheckpoint> Reconstructor::Save() {
  ReadAll();
  // Queued steps are done first: the rows, the counters and the losses must belong to the same
  // step.
  ReconstructCheckpoint checkpoint;
  checkpoint.counters = {step_,
                         num_culled_degenerate_,
                         num_skipped_gradients_,
                         num_overflowed_renders_,
                         refiner_.counts().num_refined,
                         refiner_.counts().num_split,
                         num_skipped_depths_,
                         position_,
                         depth_term_.left_out() ? 1 : 0};
  checkpoint.needs = needs_.Save();
  std::ostringstream random;
  random << random_;
  checkpoint.random = random.str();
  checkpoint.views_left.assign(sampler_.left().begin(), sampler_.left().end());
  checkpoint.gaussians = state_.DownloadRows();
  // After a device error the downloads are not the state.
  if (const std::string error = backend_.error(); !error.empty()) {
    return absl::InternalError(absl::StrCat("after step ", step_, ": ", error));
  }
  return checkpoint;
}

// Steps of METHOD.md section 1: train on a view each, then density control, opacity reset and
// refinement where they are due after the last of them.
absl::StatusOr<StepReport> Reconstructor::Step() {
  std::vector<StepInput> steps;
  const int end = EndOfSteps();
  for (int position = position_; position < end; ++position) steps.push_back(DrawStep(position));
  queue_.Train(steps);
  while (queue_.full()) ReadOldest();

  const int last = end - 1;
  const bool densify = densifier_.Due(last);
  // What follows changes the Gaussians or reads the losses: all steps must have been done, those
  // whose render overflowed repeated, on the Gaussians that they were queued for.
  if (ChangesGaussiansAfter(last)) ReadAll();
  if (densify) {
    const bool has_depth = depth_term_.InEffect(schedule_.DepthWeightAt(last));
    // Draws the seed of the round, after the draws of the steps.
    RETURN_IF_ERROR(densifier_.Apply(last, has_depth, state_, random_));
  }
  if (densify || end == options_.num_steps) RETURN_IF_ERROR(ClearFreeSpace());
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
bool Reconstructor::ChangesGaussiansAfter(int position) const {
  return densifier_.Due(position) || densifier_.OpacityResetDue(position) ||
         refiner_.Due(position) || needs_.EndsWindow(position) ||
         position + 1 == options_.num_steps;
}

// Returns the position behind the steps that are done at once from position_ on.
int Reconstructor::EndOfSteps() const {
  int end = position_ + 1;
  while (end - position_ < queue_.steps_at_once() && !ChangesGaussiansAfter(end - 1)) {
    ++end;
  }
  return end;
}

// The draws of a step are in a fixed order: the view, then the depth patch.
StepInput Reconstructor::DrawStep(int position) {
  StepInput input;
  input.position = position;
  input.view = sampler_.Next(random_);
  input.shrink = schedule_.ShrinkAt(position);
  input.num_gaussians = state_.count();
  input.dropout = DropoutOf(step_ + position - position_, position);
  input.depth = depth_term_.PlanFor(views_.At(input.view, input.shrink),
                                    schedule_.DepthWeightAt(position), random_);
  return input;
}

// Reads the result of the oldest queued step; waits for it. A step whose render overflowed is
// queued again and read later.
void Reconstructor::ReadOldest() {
  const std::optional<StepResult> popped = queue_.Pop();
  if (!popped) {
    ++num_overflowed_renders_;
    return;
  }
  const StepResult& result = *popped;
  needs_.RecordLoss(LossOf(result));
  num_culled_degenerate_ += result.counters[kNumCulledDegenerate];
  num_skipped_gradients_ += result.counters[kNumSkippedGradientRows];
  if (result.input.depth.weight > 0) {
    num_skipped_depths_ += result.loss_sums[kFirstDepthSum + kDepthSkipped] > 0;
    needs_.RecordDepth(DepthExplained(result));
  }
  newest_ = result;
}

void Reconstructor::ReadAll() {
  while (!queue_.empty()) ReadOldest();
}

// Returns the image loss of METHOD.md section 1, without the depth terms.
double Reconstructor::LossOf(const StepResult& result) const {
  const auto& sums = result.loss_sums;
  const double num = std::max(1.0, sums[kSumPixelChannels]);  // 0: all of the view is ignored
  return (1 - options_.ssim_weight) * sums[kSumL1] / num +
         options_.ssim_weight * (1 - sums[kSumSsim] / num);
}

// Returns the share of the prior's spread that the fit to the whole view explains: 1 minus mean
// residual over mean deviation. 0 where the view carries no fit.
double Reconstructor::DepthExplained(const StepResult& result) const {
  const double* sums = result.loss_sums.data() + kFirstDepthSum;
  const double spread = views_.At(result.input.view, result.input.shrink).prior_deviation;
  if (sums[kDepthSkipped] > 0 || spread <= 0) return 0;
  return 1 - sums[kSumDepthView] / (double{result.input.depth.weight} * spread);
}

// Carries out what SceneNeeds decides at the end of a window (METHOD.md section 1, "What a scene
// does not need"). Ending the stage early moves the schedule position to the start of the last
// closing_share.
void Reconstructor::DropUnneededParts() {
  const SceneNeeds::Decision decision = needs_.Decide(position_ - 1);
  if (decision.leave_out_depth && !depth_term_.left_out()) {
    depth_term_.LeaveOut();
    skipped_.push_back({Part::kDepth,
                        "the depth priors do not agree with the depth of what the photographs show",
                        step_});
  }
  if (decision.prune_sh_degree) {
    const int earned =
        SufficientShDegree(backend_, views_, NearPlane(), state_, options_.min_band_gain);
    if (earned < state_.sh_degree()) {
      skipped_.push_back({Part::kBands,
                          absl::StrCat("spherical harmonics of degrees over ", earned,
                                       " gain less than ", options_.min_band_gain, " dB"),
                          step_});
      state_.LimitShDegree(earned);
    }
  }
  if (decision.close) {
    const auto closing = static_cast<int>(std::lround(options_.closing_share * options_.num_steps));
    const int saved = options_.num_steps - closing - position_;
    skipped_.push_back({Part::kSteps,
                        absl::StrCat("the loss of the training views has stopped falling: ",
                                     closing, " steps close the schedule"),
                        step_, saved});
    position_ += saved;
  }
}

// Returns the dropout of a step. Its seed depends on nothing that a checkpoint would have to hold.
Dropout Reconstructor::DropoutOf(int step, int position) const {
  if (position >= options_.dropout_until * options_.num_steps) return {};
  constexpr uint64_t kMix = 0x9e3779b97f4a7c15;
  const uint64_t seed = (options_.seed * kMix + static_cast<uint64_t>(step)) * kMix;
  return {options_.dropout, static_cast<uint32_t>(seed >> 32)};
}

// Returns the near plane, scene units: a hundredth of the scene's radius.
float Reconstructor::NearPlane() const { return static_cast<float>(0.01 * scene_radius_); }

absl::Status Reconstructor::Refine(const StepInput& input) {
  return refiner_.Apply({input.view, views_.At(input.view, input.shrink).pinhole, NearPlane()},
                        state_);
}

// After each round of density control, so that it cannot fill the free space again, and at the end.
absl::Status Reconstructor::ClearFreeSpace() {
  if (free_space_.empty()) return absl::OkStatus();
  const int64_t num_removed =
      state_.Remove([this](const Eigen::Vector3f& mean) { return free_space_.Contains(mean); });
  if (num_removed >= 0) return absl::OkStatus();
  return absl::ResourceExhaustedError(
      absl::StrCat("out of memory for ", state_.count(), " Gaussians"));
}

// Reports the state after a step. The number of steps shrinks when steps are skipped. Returns
// INTERNAL with the backend's error.
absl::StatusOr<StepReport> Reconstructor::Report() const {
  if (const std::string error = backend_.error(); !error.empty()) {
    return absl::InternalError(absl::StrCat("step ", step_, ": ", error));
  }
  StepReport report;
  report.step = step_;
  report.num_steps = step_ + options_.num_steps - position_;
  report.num_gaussians = state_.count();
  report.num_culled_degenerate = num_culled_degenerate_;
  report.num_skipped_gradients = num_skipped_gradients_;
  report.num_void_renders = num_overflowed_renders_;
  report.num_refined = refiner_.counts().num_refined;
  report.num_refine_split = refiner_.counts().num_split;
  report.num_skipped_depths = num_skipped_depths_;
  if (!newest_) return report;
  const auto& sums = newest_->loss_sums;
  const double num = std::max(1.0, sums[kSumPixelChannels]);
  report.loss = LossOf(*newest_);
  // 1e-10 caps the PSNR at 100 dB. The sums are those of the newest step read, which on a device
  // may be some steps old.
  const double mse = std::max(1e-10, sums[kSumSquared] / num);
  report.psnr = -10 * std::log10(mse);
  if (newest_->input.depth.weight > 0) {
    report.depth_loss =
        sums[kFirstDepthSum + kSumDepthView] + sums[kFirstDepthSum + kSumDepthLocal];
  }
  return report;
}

}  // namespace pepeseg
