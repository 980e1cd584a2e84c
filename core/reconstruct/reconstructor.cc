#include "core/reconstruct/reconstructor.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <sstream>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/reconstruct/blurred_views.h"

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

// Returns a slot for each step that is done at once.
std::deque<StepSlot> MakeSlots(Backend& backend, const ReconstructOptions& options,
                               int64_t max_pixels) {
  std::deque<StepSlot> slots;
  const int num_slots = StepsAtOnce(backend, options, max_pixels);
  for (int slot = 0; slot < num_slots; ++slot) slots.emplace_back(backend, max_pixels);
  return slots;
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
      options_(WithDepthWeight(options, capture)),
      skipped_(SkippedTerms(options, capture)),
      scene_radius_(SceneRadius(capture)),
      random_(options.seed),
      points_(StartingPoints(capture, options, random_)),
      schedule_(options_, scene_radius_, PixelSpan(capture, points_)),
      refiner_(backend, capture, options, schedule_),
      views_(backend, capture,
             {options.coarse_until > 0, options_.depth_weight > 0,
              options.disparity_as_inverse_depth}),
      blurred_(options.blurred_share < 1 ? FindBlurred(capture) : std::vector<bool>()),
      sampler_(RoundShares(views_.size(), blurred_, options.blurred_share)),
      log_scales_(BoundLogScales(capture, points_)),
      free_space_(capture, options.camera_clearance),
      state_(backend, InitialGaussians(points_, options.sh_degree, log_scales_)),
      densifier_(backend, options, {scene_radius_, views_.num_pixels(), state_.count()}),
      slots_(MakeSlots(backend, options_, views_.max_pixels())),
      depth_term_(backend, options_, views_.max_pixels()),
      entry_capacities_(views_.size()),
      results_(backend, static_cast<int>(slots_.size())),
      needs_(options_, views_.size()) {}

absl::Status Reconstructor::Allocated() const {
  if (views_.allocated() && refiner_.allocated() && state_.allocated() && depth_term_.allocated() &&
      results_.allocated() && std::ranges::all_of(slots_, &StepSlot::allocated)) {
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
  while (!results_.empty()) DrainOldest();
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
  std::vector<int64_t> entry_capacities;
  const int end = EndOfSteps();
  for (int position = position_; position < end; ++position) {
    steps.push_back(DrawStep(position));
    entry_capacities.push_back(entry_capacities_.For(steps.back()));
  }
  TrainOn(steps, entry_capacities);
  while (results_.full()) DrainOldest();

  const int last = end - 1;
  const bool densify = densifier_.Due(last);
  // What follows changes the Gaussians or reads the losses: all steps must have been done, those
  // whose render overflowed repeated, on the Gaussians that they were queued for.
  if (ChangesGaussiansAfter(last)) {
    while (!results_.empty()) DrainOldest();
  }
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
  while (end - position_ < static_cast<int>(slots_.size()) && !ChangesGaussiansAfter(end - 1)) {
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

// Queues the work of steps that are done at once, one for each slot. With tile-entry capacities
// nothing waits, so that the backend can replay the steps as a CUDA graph: one for each number of
// steps and size of the photographs, with and without depth. With a capacity of 0 the host waits
// for the count of entries.
void Reconstructor::TrainOn(std::span<const StepInput> steps,
                            std::span<const int64_t> entry_capacities) {
  std::vector<std::function<void()>> gradients;
  for (size_t k = 0; k < steps.size(); ++k) {
    gradients.push_back([&, k] {
      QueueGradient(steps[k], ShDegreeAt(steps.front().position), entry_capacities[k], slots_[k]);
    });
  }
  const auto ops = [&] {
    backend_.Branches(gradients);
    QueueUpdates(steps);
  };
  const bool waits = std::ranges::find(entry_capacities, 0) != entry_capacities.end();
  if (waits) {
    ops();
  } else {
    const int num_steps = static_cast<int>(steps.size());
    const int depth = steps.front().depth.weight > 0 ? 1 : 0;
    constexpr int kKinds = 16;  // of steps: 2 * shrink + depth
    backend_.Sequence(kKinds * num_steps + 2 * steps.front().shrink + depth, ops);
  }
  for (size_t k = 0; k < steps.size(); ++k) {
    results_.Push(steps[k], static_cast<int>(k), slots_[k].loss_sums.span(),
                  slots_[k].scratch.counters.span());
  }
}

// Forward pass, loss and backward pass on one view (METHOD.md section 1).
void Reconstructor::QueueGradient(const StepInput& input, int sh_degree, int64_t entry_capacity,
                                  StepSlot& slot) {
  const TrainingView& view = views_.At(input.view, input.shrink);
  const int64_t size = 3 * int64_t{view.pinhole.width} * view.pinhole.height;
  const auto color = slot.color.span().Subspan(0, size);
  const auto color_grad = slot.color_grad.span().Subspan(0, size);
  const DepthImages depth = depth_term_.ImagesFor(view, input.depth);

  backend_.Render({.gaussians = state_.parameters(),
                   .view = view.pinhole,
                   .near_plane = NearPlane(),
                   .active_sh_degree = sh_degree,
                   .dropout = input.dropout,
                   .scratch = &slot.scratch,
                   .color = color,
                   // Empty where the step has no depth term.
                   .alpha = depth.alpha,
                   .depth = depth.depth,
                   .inverse_depth = depth.inverse_depth,
                   .entry_room = entry_capacity});
  backend_.ImageLoss({.width = view.pinhole.width,
                      .height = view.pinhole.height,
                      .color = color,
                      .target = view.photo.span(),
                      .ignore = view.ignore.span(),
                      .ssim_weight = options_.ssim_weight,
                      .color_grad = color_grad,
                      .sums = slot.loss_sums.span().Subspan(0, kNumImageLossSums)});
  depth_term_.Compare(view, input.depth,
                      slot.loss_sums.span().Subspan(kFirstDepthSum, kNumDepthLossSums));
  backend_.RenderBackward({.view = view.pinhole,
                           .color_grad = color_grad,
                           .alpha_grad = depth.alpha_grad,
                           .depth_grad = depth.depth_grad,
                           .scratch = &slot.scratch});
}

// A step of Adam for each gradient in the slots (METHOD.md section 1). The rates are those of the
// first of them.
void Reconstructor::QueueUpdates(std::span<const StepInput> steps) {
  std::vector<UpdateStep> updates;
  for (size_t k = 0; k < steps.size(); ++k) {
    updates.push_back({.view = views_.At(steps[k].view, steps[k].shrink).pinhole,
                       .dropout = steps[k].dropout,
                       .scratch = &slots_[k].scratch});
  }
  const int position = steps.front().position;
  backend_.Update({.steps = updates,
                   .active_sh_degree = ShDegreeAt(position),
                   .learning_rates = schedule_.RatesAt(position),
                   .min_log_scale = log_scales_.min,
                   .max_log_scale = log_scales_.max,
                   .gaussians = state_.parameters(),
                   .moment1 = state_.moment1(),
                   .moment2 = state_.moment2(),
                   .num_steps = state_.num_steps(),
                   .stats = state_.stats()});
}

// Returns the SH degree in use: degrees may have been pruned.
int Reconstructor::ShDegreeAt(int position) const {
  return std::min(schedule_.ShDegreeAt(position), state_.sh_degree());
}

// Reads the result of the oldest queued step; waits for it. A step whose render overflowed its
// tile-entry capacity has changed nothing and is queued again, now with as much as it needs.
void Reconstructor::DrainOldest() {
  const StepResult result = results_.Pop();
  if (result.overflowed) {
    ++num_overflowed_renders_;
    constexpr int64_t kWaitForCount = 0;  // no capacity: the host waits for the count of entries
    TrainOn({&result.input, 1}, {&kWaitForCount, 1});
    return;
  }
  entry_capacities_.Record(result);
  needs_.RecordLoss(LossOf(result));
  num_culled_degenerate_ += result.counters[kNumCulledDegenerate];
  num_skipped_gradients_ += result.counters[kNumSkippedGradientRows];
  if (result.input.depth.weight > 0) {
    num_skipped_depths_ += result.loss_sums[kFirstDepthSum + kDepthSkipped] > 0;
    needs_.RecordDepth(DepthExplained(result));
  }
  newest_ = result;
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
    skipped_.push_back({"depth",
                        "the depth priors do not agree with the depth of what the photographs show",
                        step_});
  }
  if (decision.prune_sh_degree) {
    const int earned =
        SufficientShDegree(backend_, views_, NearPlane(), state_, options_.min_band_gain);
    if (earned < state_.sh_degree()) {
      skipped_.push_back({"bands",
                          absl::StrCat("spherical harmonics of degrees over ", earned,
                                       " gain less than ", options_.min_band_gain, " dB"),
                          step_});
      state_.LimitShDegree(earned);
    }
  }
  if (decision.close) {
    const auto closing = static_cast<int>(std::lround(options_.closing_share * options_.num_steps));
    const int saved = options_.num_steps - closing - position_;
    skipped_.push_back({"steps",
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
  report.stage = "reconstruct";
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
