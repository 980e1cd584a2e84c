#include "core/reconstruct/scene_needs.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>

namespace pepeseg {
namespace {

// Share of num_steps after which SH degrees are measured. The last degree is in use from 3 / 30 of
// the steps on, so that all have been trained for a while.
constexpr double kPruneShFrom = 0.3;

// Share of the prior's spread that a fit must explain to agree. Noise reaches 0.02, monocular
// priors 0.5 and more.
constexpr double kAgrees = 0.2;

constexpr int kMostViews = 16;  // most training views to render

// Measures how well the training views are rendered with a limited SH degree.
class DegreeMeter {
 public:
  DegreeMeter(Backend& backend, const TrainingViews& views, float near_plane)
      : backend_(backend),
        views_(views),
        near_plane_(near_plane),
        color_(backend, 3 * views.max_pixels()),
        color_grad_(backend, 3 * views.max_pixels()),
        sums_(backend, kNumImageLossSums) {}

  bool allocated() const { return !color_.empty() && !color_grad_.empty() && !sums_.empty(); }

  // Returns the mean squared error over the chosen views, rendered with degrees up to `sh_degree`.
  double MeanSquaredError(const GaussianPlanes& gaussians, int sh_degree) {
    // Evenly spread views, always the same: errors of two degrees must be of the same pixels.
    const int every = (views_.size() + kMostViews - 1) / kMostViews;
    double squared = 0, num = 0;
    for (int view = 0; view < views_.size(); view += every) {
      const std::array<double, kNumImageLossSums> sums =
          Compare(gaussians, sh_degree, views_.At(view, 1));
      squared += sums[kSumSquared];
      num += sums[kSumPixelChannels];
    }
    return num > 0 ? squared / num : 0;
  }

 private:
  // Renders the view and compares it with its photograph at full size; waits for the sums.
  std::array<double, kNumImageLossSums> Compare(const GaussianPlanes& gaussians, int sh_degree,
                                                const TrainingView& view) {
    const int64_t size = 3 * int64_t{view.pinhole.width} * view.pinhole.height;
    backend_.Render({.gaussians = gaussians,
                     .view = view.pinhole,
                     .near_plane = near_plane_,
                     .active_sh_degree = sh_degree,
                     .scratch = &scratch_,
                     .color = color_.span().Subspan(0, size),
                     .for_backward = false});
    backend_.ImageLoss({.width = view.pinhole.width,
                        .height = view.pinhole.height,
                        .color = color_.span().Subspan(0, size),
                        .target = view.photo.span(),
                        .ignore = view.ignore.span(),
                        .color_grad = color_grad_.span().Subspan(0, size),
                        .sums = sums_.span()});
    std::array<double, kNumImageLossSums> sums = {};
    sums_.Download(sums);
    return sums;
  }

  Backend& backend_;
  const TrainingViews& views_;
  float near_plane_;
  RenderScratch scratch_;
  Buffer<float> color_, color_grad_;
  Buffer<double> sums_;
};

}  // namespace

// The depth loss is skipped where no view has a prior, and where priors are made of the starting
// points.
std::vector<SkippedPart> SkippedParts(const ReconstructOptions& options, const Capture& capture) {
  std::vector<SkippedPart> skipped;
  if (options.depth_weight != 0 && !HasTrainingGeometry(capture)) {
    skipped.push_back(
        {Part::kDepth, HasTrainingDepth(capture)
                           ? "the depth priors were made from the points that training starts from"
                           : "no training view has a depth prior"});
  }
  const bool has_masks = std::ranges::any_of(
      capture.views, [](const View& view) { return !view.held_out && !view.masks.empty(); });
  if (options.refine_keep != RefineKeep::kNone && !has_masks) {
    skipped.push_back({Part::kRefinement, "no training view has masks"});
  }
  return skipped;
}

void DepthAgreement::Add(double explained) {
  ++state_.num;
  state_.num_agreeing += explained > kAgrees;
}

bool DepthAgreement::Failed() {
  const bool failed = state_.num > 0 && static_cast<double>(state_.num_agreeing) <
                                            min_share_ * static_cast<double>(state_.num);
  const bool twice = failed && state_.failed_before != 0;
  state_ = {0, 0, failed ? 1 : 0};
  return twice;
}

SceneNeeds::SceneNeeds(const ReconstructOptions& options, int num_views)
    : options_(options),
      window_(Convergence::Window(num_views)),
      loss_(options.min_loss_fall),
      depth_(options.min_depth_agreement) {}

void SceneNeeds::RecordLoss(double loss) { loss_.Add(loss); }

// True when density control, smaller photographs and refinement are over after `step`: the loss is
// then comparable from window to window.
bool SceneNeeds::Grown(int step) const {
  const double share = static_cast<double>(step + 1) / options_.num_steps;
  return share >= std::max({options_.densify_until, options_.coarse_until,
                            options_.refine_from + options_.refine_length});
}

// Both agreement and convergence begin their next window here, whatever is decided.
SceneNeeds::Decision SceneNeeds::Decide(int step) {
  const double share = static_cast<double>(step + 1) / options_.num_steps;
  const double before = static_cast<double>(step + 1 - window_) / options_.num_steps;
  Decision decision;
  decision.leave_out_depth = depth_.Failed();
  // True in the one window in which the schedule passes kPruneShFrom.
  decision.prune_sh_degree =
      options_.min_band_gain > 0 && before < kPruneShFrom && share >= kPruneShFrom;
  decision.close = loss_.StoppedFalling() && Grown(step) && share < 1 - options_.closing_share;
  return decision;
}

// Save and Restore list the same six numbers in the same order.
std::vector<double> SceneNeeds::Save() const {
  const Convergence::State& loss = loss_.state();
  const DepthAgreement::State& depth = depth_.state();
  return {loss.sum,
          loss.num,
          loss.before,
          static_cast<double>(depth.num),
          static_cast<double>(depth.num_agreeing),
          static_cast<double>(depth.failed_before)};
}

void SceneNeeds::Restore(const std::vector<double>& state) {
  assert(state.size() == kNumState);
  loss_.Restore({state[0], state[1], state[2]});
  depth_.Restore({static_cast<int64_t>(state[3]), static_cast<int64_t>(state[4]),
                  static_cast<int64_t>(state[5])});
}

int SufficientShDegree(Backend& backend, const TrainingViews& views, float near_plane,
                       GaussianState& state, double min_gain) {
  // Tries degrees from 0 on, so that the error need not fall from degree to degree. A NaN fails the
  // comparison and keeps all degrees.
  DegreeMeter meter(backend, views, near_plane);
  if (!meter.allocated()) return state.sh_degree();  // cannot measure: keep all degrees
  const double of_all = meter.MeanSquaredError(state.parameters(), state.sh_degree());
  const double most = of_all * std::pow(10, 0.1 * min_gain);  // the error min_gain dB below
  int earned = 0;
  while (earned < state.sh_degree() &&
         !(meter.MeanSquaredError(state.parameters(), earned) <= most)) {
    ++earned;
  }
  return earned;
}

}  // namespace pepeseg
