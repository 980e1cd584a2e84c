#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/query/segmenter.h"
#include "core/scene/mask_set.h"

namespace pepeseg {

// Protocol "agreement with SAM", for scenes without labels: how well one click finds the masks that
// SAM makes of a held-out photograph (METHOD.md section 5).
struct SamAgreementOptions {
  // Minimum of SAM's own scores for a mask to count, [0, 1].
  double min_predicted_iou = 0.88;
  double min_stability = 0.92;
  int64_t min_pixels = 100;  // pixels of a mask without ignored ones, at least 1
  int num_proposals = 3;     // proposals of which the best one counts, at least 1
};
// Returns INVALID_ARGUMENT, which names the option, its value and its limits.
absl::Status Validate(const SamAgreementOptions& options);

// SAM's masks of one view.
struct SamView {
  ModelView view;
  MaskSet masks;  // of the view's size
  // [masks.num_masks] SAM's estimate of a mask's IoU, and its stability score. Empty: not known,
  // all masks count.
  std::vector<double> predicted_iou, stability;
  std::vector<uint8_t> ignore;  // [height, width], non-zero: not scored; or empty
};

// The agreement with one mask.
struct SamMaskScore {
  int mask = 0;            // index in the view's masks
  int64_t num_pixels = 0;  // without ignored ones
  PointPrompt click;       // deepest pixel of the mask
  double first_iou = 0;    // of the proposal with the most support; 0: nothing is under the click
  double best_iou = 0;     // best of num_proposals, most support first
};
struct SamViewScores {
  std::string view;
  std::vector<SamMaskScore> masks;     // those that count
  double first_iou = 0, best_iou = 0;  // means over them; 0 without one
};
struct SamAgreement {
  std::vector<SamViewScores> views;  // as given
  int64_t num_masks = 0;             // that count
  // Means over all masks of all views. SAM's three masks for a click are scored as best_iou
  // (Kirillov et al. 2023, section 7.1).
  double first_iou = 0, best_iou = 0;
};

// Clicks each mask that counts in its own view. Calls `check_cancelled` before each mask and
// returns its error. Views that were trained on are accepted; Evaluate refuses them. Returns
// INVALID_ARGUMENT, which names the view, if an array does not fit it, and if no mask counts.
// segment: of each proposal.
absl::StatusOr<SamAgreement> ScoreSamAgreement(const Segmenter& segmenter,
                                               std::span<const SamView> views,
                                               const SamAgreementOptions& options,
                                               const SegmentOptions& segment,
                                               absl::FunctionRef<absl::Status()> check_cancelled);

}  // namespace pepeseg
