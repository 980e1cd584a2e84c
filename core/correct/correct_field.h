#pragma once

#include <optional>
#include <span>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/correct/corrected_pixels.h"
#include "core/query/segmenter.h"
#include "core/scene/model.h"

// Corrections that teach (METHOD.md section 4): a thing's masks in some views change the features
// of a model so that the thing is found in all views.

namespace pepeseg {

inline constexpr size_t kMaxCorrections = 16;

struct CorrectedField {
  FeatureField field;  // of the corrected model
  // Gaussians whose feature has changed. 0: no change finds the masks better.
  int64_t num_changed = 0;
  // The scale (quantile) and the threshold (cosine) at which the thing is found best.
  double scale = 0, threshold = 0;
  // By correction: IoU of its mask and what the best query finds, of the model as it was and as it
  // is now.
  std::vector<double> iou_before, iou_after;
};

// Changes the features of a model so that one query finds what the masks show. The scales at which
// it does are those around `scale` (quantile), or where the model fits the masks best. All other
// features, the gate and the scales stay.
//
// The device is used once for each view; everything else runs on the host, so that queries are
// answered meanwhile. Takes at most a few seconds of two cores: see
// tests/bench/results/corrections.md. Calls `check` between the parts; an error that it returns
// ends the correction with that error.
//
// INVALID_ARGUMENT, with the fault "[INDEX].mask" or "[INDEX].view" (PromptFault): not 1 to
// kMaxCorrections corrections, a view is named twice, a mask does not have its view's size, is
// empty or leaves nothing outside that has a feature, or contradicts the other masks: they show
// another thing. NothingThereError: nothing with a feature is under a mask. FAILED_PRECONDITION:
// the model has no features. Other errors are those of Segmenter::Rows.
absl::StatusOr<CorrectedField> CorrectField(const Segmenter& segmenter,
                                            std::span<const Correction> corrections,
                                            std::optional<double> scale,
                                            absl::FunctionRef<absl::Status()> check);

// Returns an upper bound of the host's memory that CorrectField takes, bytes.
int64_t BytesOfCorrection(const Model& model, size_t num_corrections);

}  // namespace pepeseg
