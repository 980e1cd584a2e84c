#include "core/reconstruct/sh_pruning.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace pepeseg {
namespace {

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
