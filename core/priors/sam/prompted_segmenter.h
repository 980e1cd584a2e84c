#pragma once

#include <array>
#include <optional>
#include <span>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/priors/sam/sam_embedding.h"
#include "core/scene/capture.h"

namespace pepeseg {

// A click, in pixels of the photograph; (0.5, 0.5) is the centre of the first pixel.
struct PromptPoint {
  float x = 0, y = 0;
  bool positive = true;  // false: the mask must not hold the point
};
using SegmenterPrompt = std::vector<PromptPoint>;

// A mask, with points of the thing that is meant, which the segmenter is to improve; or a box.
struct MaskPrompt {
  SegmenterPrompt points;
  std::optional<std::array<PromptPoint, 2>> box;  // its first and its last corner
  // [extent, extent], positive inside the mask; empty: no mask.
  std::vector<float> logits;
};

// A prompted segmenter's answers to a batch of prompts: kMasks masks for each, on a grid of
// width x height cells over the photograph, with kExtent cells along its longer side.
struct PromptAnswers {
  static constexpr int kMasks = 4, kExtent = 256;

  int width = 0, height = 0;  // cells
  double cells_per_pixel = 1;
  std::vector<float> logits;  // [prompts, kMasks, height, width]: positive inside the mask
  std::vector<float> ious;    // [prompts, kMasks]: estimated IoU with the intended mask

  // For a prompt of one point use masks 1 to 3: the part, the object and the whole that it may
  // mean. For a prompt of several points use mask 0.
  std::span<const float> Logits(size_t prompt, size_t mask) const {
    const size_t cells = static_cast<size_t>(width) * height;
    return std::span(logits).subspan((prompt * kMasks + mask) * cells, cells);
  }
  float Iou(size_t prompt, size_t mask) const { return ious[prompt * kMasks + mask]; }
};

struct ProposalRequest;
struct ProposedMask;
struct Proposals;
struct TargetedPrompt;

// A network that segments what points in a photograph refer to, as SAM does (Kirillov et al. 2023).
// Not thread-safe.
class PromptedSegmenter {
 public:
  virtual ~PromptedSegmenter() = default;

  // Cells along the longer side of the photograph in its masks.
  virtual int extent() const { return PromptAnswers::kExtent; }
  // Sets the RGB photograph that later prompts refer to, which must stay as it is while they do.
  // Returns RESOURCE_EXHAUSTED when out of memory.
  virtual absl::Status SetPhotograph(const Image& photo) = 0;
  // Answers at least one prompt, all with the same number of points. Call SetPhotograph first.
  virtual absl::StatusOr<PromptAnswers> Segment(std::span<const SegmenterPrompt> prompts) = 0;

  // The three calls below are UNIMPLEMENTED unless a segmenter overrides them.
  //
  // Returns what SetPhotograph has computed.
  virtual absl::StatusOr<SamEmbedding> Embedding();
  // Sets the photograph by its embedding, which must stay as it is while prompts refer to it.
  // Returns INVALID_ARGUMENT for one of another size, and the errors of SetPhotograph.
  virtual absl::Status SetEmbedding(const SamEmbedding& embedding);
  // Answers one prompt by a mask, a box or both, whose mask 0 is the one to use.
  virtual absl::StatusOr<PromptAnswers> SegmentByMask(const MaskPrompt& prompt);

  // The steps of SegmentPhotograph (automatic_masks.h). Each calls `progress` from time to time and
  // returns its error. By default the host computes them from the answers of Segment; a segmenter
  // that keeps its logits on a device overrides them.
  //
  // Prompts at points and returns the masks that are worth keeping (mask_proposals.h).
  virtual absl::StatusOr<Proposals> Propose(const ProposalRequest& request,
                                            absl::FunctionRef<absl::Status()> progress);
  // Returns for each prompt the answer that has the highest IoU with the prompt's target; its area
  // is 0 where no answer has a cell of the target. All have the same number of points.
  virtual absl::StatusOr<std::vector<ProposedMask>> Match(
      std::span<const TargetedPrompt> prompts, absl::FunctionRef<absl::Status()> progress);
  // Returns the pixels of masks of the view's photograph (PixelsOfLogits).
  virtual absl::StatusOr<std::vector<std::vector<PixelRun>>> Enlarge(
      std::span<const ProposedMask> masks, const View& view);
};

// Returns the grid of PromptAnswers for a photograph of this size, with `extent` cells along its
// longer side, without answers.
PromptAnswers AnswerGrid(int photo_width, int photo_height, int extent = PromptAnswers::kExtent);

// Returns the cells of the grid of squares with `extent` cells a side, [masks, extent, extent]: the
// rest shows the padding of the network's frame.
std::vector<float> WithoutPadding(std::span<const float> squares, int extent,
                                  const PromptAnswers& grid);

// Returns the centres of a grid of points_per_side x points_per_side squares over the photograph.
// Neighbours are far apart in the order, so that an early answer can make a later prompt needless.
std::vector<PromptPoint> GridPoints(const Image& photo, int points_per_side);

// Returns the point of each mask that is farthest from its border, on the grid of PromptAnswers. A
// mask that is too small for the grid has none.
std::vector<PromptPoint> RegionPoints(const MaskSet& masks);

}  // namespace pepeseg
