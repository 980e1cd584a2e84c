#pragma once

#include <cstdint>
#include <span>

#include "absl/functional/function_ref.h"
#include "absl/status/statusor.h"
#include "core/priors/sam/prompted_segmenter.h"
#include "core/scene/capture.h"

namespace pepeseg {

// Options of segmenting a photograph by prompts at many points (METHOD.md section 6). The defaults
// are those at which a small SAM's masks are best: tests/bench/results/sam_masks.md. SAM's own
// generator has higher thresholds and suppresses duplicates by their boxes.
struct AutomaticMaskOptions {
  int points_per_side = 12;    // points along a side of the grid over the photograph; 0: no grid
  bool region_points = false;  // first prompt at the deepest point of each embedded mask
  // Area, as a share of the photograph, below which a sure mask makes prompts at grid points inside
  // it needless. 0: no grid point is skipped.
  double settled_area = 0;
  // A mask is sure from these values on. IoU: as the network estimates it. Stability: IoU of the
  // mask at logits over 1 with the mask at logits over -1.
  double min_iou = 0.8, min_stability = 0.85;
  // The same thresholds for fillers: masks of points that no sure mask holds.
  double min_filler_iou = 0.7, min_filler_stability = 0.7;
  // Minimum IoU of an answer with the remainder of a mask that holds another, for which it was
  // prompted. 1: remainders are not prompted for.
  double min_remainder_iou = 0.6;
  bool join_embedded = true;  // add the embedded masks that are not duplicates of a better one
};

struct AutomaticMasks {
  MaskSet masks;        // of the photograph's size, without ignored pixels, the surest first
  int num_prompts = 0;  // prompts sent to the segmenter
};

// Computes the masks of a view's photograph. embedded: masks by the built-in method
// (EmbeddedMasks), used as the options say; may be empty. Calls `progress` before each run of the
// segmenter. Returns the error of `progress` or of the segmenter.
absl::StatusOr<AutomaticMasks> SegmentPhotograph(PromptedSegmenter& segmenter, const View& view,
                                                 const MaskSet& embedded,
                                                 const AutomaticMaskOptions& options,
                                                 absl::FunctionRef<absl::Status()> progress);

// Returns the masks of `first`, then those of `second`, without the pixels where `ignore` is
// non-zero: [height, width], or empty. Drops empty masks and duplicates: those whose IoU with a
// mask before them is over 0.8. `second` may be a set without size and masks.
MaskSet JoinMasks(const MaskSet& first, const MaskSet& second, std::span<const uint8_t> ignore);

}  // namespace pepeseg
