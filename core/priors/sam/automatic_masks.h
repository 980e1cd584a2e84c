#pragma once

#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/statusor.h"
#include "core/priors/sam/prompted_segmenter.h"
#include "core/scene/capture.h"

namespace pepeseg {

// How a photograph is segmented by asking about many points in it. The thresholds are those at
// which a small SAM's masks are best, see tests/bench/results/sam_masks.md: SAM's own generator
// asks for more, and suppresses by boxes.
struct AutomaticMaskOptions {
  int points_per_side = 12;    // of a grid over the photograph; 0: no grid
  bool region_points = false;  // the deepest point of each embedded mask is asked about, first
  // Share of the photograph: a point of the grid is passed over when a sure mask that is smaller
  // holds it. 0: no point is.
  double settled_area = 0;
  // Of a sure mask: the IoU that the network estimates, and that of the mask at logits over
  // `stability_offset` with the one at logits over its negative.
  double min_iou = 0.8, min_stability = 0.85;
  double stability_offset = 1;
  // Likewise of a mask of a point that no sure one holds.
  double min_filler_iou = 0.7, min_filler_stability = 0.7;
  double duplicate_iou = 0.8;  // with a better mask, at which a mask is dropped
  // Where a mask holds another, the rest is asked for; the answer is kept if its IoU with the rest
  // is over this. 1: nothing is asked for.
  double min_remainder_iou = 0.6;
  int max_remainders = 32;                    // a photograph
  double min_area = 0.0005, max_area = 0.95;  // of a mask, as a share of the photograph
  int prompts_per_run = 4;
  bool join_embedded = true;  // embedded masks are added that are no duplicates of a better one
};

struct AutomaticMasks {
  MaskSet masks;        // of the photograph's size, the surest first, without the ignored pixels
  int num_prompts = 0;  // that the segmenter was asked
};

// Masks of a view's photograph. `embedded`: those of embedded_masks.h, of which options say what
// they are used for. `progress` is called before each run of the segmenter: its error ends the
// call.
absl::StatusOr<AutomaticMasks> SegmentPhotograph(PromptedSegmenter& segmenter, const View& view,
                                                 const MaskSet& embedded,
                                                 const AutomaticMaskOptions& options,
                                                 absl::FunctionRef<absl::Status()> progress);

}  // namespace pepeseg
