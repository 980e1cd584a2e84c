#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/priors/sam/grid_mask.h"
#include "core/priors/sam/prompted_segmenter.h"

namespace pepeseg {

// IoU with a better mask over which a mask is a duplicate.
inline constexpr double kDuplicateMaskIou = 0.8;
// Areas of masks that are kept, as shares of the photograph.
inline constexpr double kMinMaskArea = 0.0005, kMaxMaskArea = 0.95;
// The stability of a mask is its area at logits over +kStabilityOffset as a share of that at logits
// over -kStabilityOffset, as in SAM.
inline constexpr float kStabilityOffset = 1;

// A mask that answers a prompt.
struct ProposedMask {
  GridMask mask;
  float iou = 0, stability = 0;        // see AutomaticMaskOptions::min_iou
  size_t cell = 0;                     // cell of the prompt's point
  std::vector<int8_t> quarter_logits;  // [height, width], see QuarterLogits
};

// A prompt, and a mask on the grid that its answer should resemble.
struct TargetedPrompt {
  SegmenterPrompt prompt;
  GridMask target;
};

// Prompts of one point each, and which answers are kept. The thresholds are described at
// AutomaticMaskOptions.
struct ProposalRequest {
  PromptAnswers grid;                  // of the photograph, without answers
  std::vector<PromptPoint> always;     // prompted at first
  std::vector<PromptPoint> unsettled;  // then at these, unless a small sure mask holds the point
  double settled_area = 0;
  double min_iou = 0, min_stability = 0, min_filler_iou = 0, min_filler_stability = 0;

  // Returns the cell that holds a point.
  size_t CellOf(const PromptPoint& point) const;
  bool HasGoodArea(int64_t area) const;
  bool IsSure(const ProposedMask& mask) const {
    return mask.iou >= min_iou && mask.stability >= min_stability;
  }
};

struct Proposals {
  // The sure masks, those with the highest IoU first, then fillers, those whose point no kept mask
  // holds. No mask is a duplicate of one before it.
  std::vector<ProposedMask> kept;
  int num_prompts = 0;
};

// Returns a mask of answers with its stability, without `cell` and `quarter_logits`.
ProposedMask ReadMask(const PromptAnswers& answers, size_t prompt, size_t mask);

// PromptedSegmenter::Propose and Match by Segment, kPromptsPerRun prompts at a time, and the choice
// of masks on the host. Call `progress` before each run. Return the error of `progress` or of the
// segmenter.
inline constexpr size_t kPromptsPerRun = 4;
absl::StatusOr<Proposals> ProposeBySegmenting(PromptedSegmenter& segmenter,
                                              const ProposalRequest& request,
                                              absl::FunctionRef<absl::Status()> progress);
absl::StatusOr<std::vector<ProposedMask>> MatchBySegmenting(
    PromptedSegmenter& segmenter, std::span<const TargetedPrompt> prompts,
    absl::FunctionRef<absl::Status()> progress);

}  // namespace pepeseg
