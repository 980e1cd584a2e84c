#pragma once

#include <cstdint>
#include <optional>

#include "core/base/progress.h"
#include "core/reconstruct/step_results.h"

namespace pepeseg {

// Sums up the results of steps for the reports of stage one.
class StepTally {
 public:
  // ssim_weight: of the image loss.
  explicit StepTally(float ssim_weight) : ssim_weight_(ssim_weight) {}

  // Totals since the start of the stage, see StepReport.
  struct Totals {
    int64_t num_culled_degenerate = 0, num_skipped_gradients = 0, num_overflowed_renders = 0;
    int64_t num_skipped_depths = 0;
  };
  const Totals& totals() const { return totals_; }
  void Restore(const Totals& totals) { totals_ = totals; }

  // Returns the image loss of METHOD.md section 1, without the depth terms.
  double LossOf(const StepResult& result) const;
  // Record a step that the device has finished, in order, and one whose render overflowed.
  void Record(const StepResult& result);
  void RecordOverflow() { ++totals_.num_overflowed_renders; }
  // Fills in the totals, and the losses and the PSNR of the newest step recorded.
  void Describe(StepReport& report) const;

 private:
  const float ssim_weight_;
  Totals totals_;
  std::optional<StepResult> newest_;
};

}  // namespace pepeseg
