#pragma once

#include <span>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/scene/capture.h"

namespace pepeseg {

// A click, in pixels of the photograph: 0.5, 0.5 is the centre of the first one.
struct PromptPoint {
  float x = 0, y = 0;
  bool positive = true;  // false: the mask leaves the point out
};
using SegmenterPrompt = std::vector<PromptPoint>;

// What a prompted segmenter answers to each of some prompts: kMasks masks, on a grid that divides
// the photograph into width x height cells, the longer side into kExtent.
struct PromptAnswers {
  static constexpr int kMasks = 4, kExtent = 256;

  int width = 0, height = 0;
  // Cells per pixel of the photograph.
  double cells_per_pixel = 1;
  std::vector<float> logits;  // [prompts, kMasks, height, width]: positive inside
  std::vector<float> ious;    // [prompts, kMasks]: as estimated, with the mask that was meant

  // Masks 1 to 3 are a part, an object and a whole that a single point may mean; mask 0 is the one
  // that several points mean.
  std::span<const float> Logits(size_t prompt, size_t mask) const {
    const size_t cells = static_cast<size_t>(width) * height;
    return std::span(logits).subspan((prompt * kMasks + mask) * cells, cells);
  }
  float Iou(size_t prompt, size_t mask) const { return ious[prompt * kMasks + mask]; }
};

// A network that segments what points in a photograph mean, as SAM does. Not thread safe.
class PromptedSegmenter {
 public:
  virtual ~PromptedSegmenter() = default;

  // The photograph, RGB, that is asked about from now on. RESOURCE_EXHAUSTED: out of memory.
  virtual absl::Status SetPhotograph(const Image& photo) = 0;
  // At least one prompt, all with the same number of points. Call SetPhotograph before.
  virtual absl::StatusOr<PromptAnswers> Segment(std::span<const SegmenterPrompt> prompts) = 0;
};

// The grid of PromptAnswers for a photograph of this size, without answers.
PromptAnswers AnswerGrid(int photo_width, int photo_height);

}  // namespace pepeseg
