#include "core/reconstruct/step_tally.h"

#include <algorithm>
#include <cmath>

namespace pepeseg {
namespace {

// 0: all of the view is ignored.
double NumPixelChannels(const StepResult& result) {
  return std::max(1.0, result.loss_sums[kSumPixelChannels]);
}

}  // namespace

double StepTally::LossOf(const StepResult& result) const {
  const auto& sums = result.loss_sums;
  const double num = NumPixelChannels(result);
  return (1 - ssim_weight_) * sums[kSumL1] / num + ssim_weight_ * (1 - sums[kSumSsim] / num);
}

void StepTally::Record(const StepResult& result) {
  totals_.num_culled_degenerate += result.counters[kNumCulledDegenerate];
  totals_.num_skipped_gradients += result.counters[kNumSkippedGradientRows];
  if (result.input.depth.weight > 0) {
    totals_.num_skipped_depths += result.loss_sums[kFirstDepthSum + kDepthSkipped] > 0;
  }
  newest_ = result;
}

void StepTally::Describe(StepReport& report) const {
  report.num_culled_degenerate = totals_.num_culled_degenerate;
  report.num_skipped_gradients = totals_.num_skipped_gradients;
  report.num_overflowed_renders = totals_.num_overflowed_renders;
  report.num_skipped_depths = totals_.num_skipped_depths;
  if (!newest_) return;
  const auto& sums = newest_->loss_sums;
  report.loss = LossOf(*newest_);
  // 1e-10 caps the PSNR at 100 dB. The sums are those of the newest step read, which on a device
  // may be some steps old.
  const double mse = std::max(1e-10, sums[kSumSquared] / NumPixelChannels(*newest_));
  report.psnr = -10 * std::log10(mse);
  if (newest_->input.depth.weight > 0) {
    report.depth_loss =
        sums[kFirstDepthSum + kSumDepthView] + sums[kFirstDepthSum + kSumDepthLocal];
  }
}

}  // namespace pepeseg
