#include "core/priors/sam/click_masks.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <opencv2/core.hpp>
#include <utility>

#include "core/base/status_macros.h"
#include "core/priors/sam/grid_mask.h"
#include "core/priors/sam/mask_logits.h"

namespace pepeseg {
namespace {

// Returns mask `k` of the only prompt, and its logits as the next prompt's, [extent, extent]: the
// padding of the network's frame is outside.
SoftMask MaskOf(const PromptAnswers& answers, size_t k, int extent, cv::Size size) {
  const std::span<const float> logits = answers.Logits(0, k);
  const cv::Mat cells(answers.height, answers.width, CV_32F, const_cast<float*>(logits.data()));
  SoftMask result;
  result.mask.pixels.resize(static_cast<size_t>(size.area()));
  cv::Mat pixels(size, CV_8U, result.mask.pixels.data());
  cv::Mat(PixelsInside(cells, answers.cells_per_pixel, size) / 255).copyTo(pixels);
  result.iou = std::clamp(static_cast<double>(answers.Iou(0, k)), 0.0, 1.0);
  result.logits.assign(static_cast<size_t>(extent) * extent, -kMostLogit);
  for (int y = 0; y < answers.height; ++y) {
    for (int x = 0; x < answers.width; ++x) {
      result.logits[static_cast<size_t>(y) * extent + x] =
          std::clamp(cells.at<float>(y, x), -kMostLogit, kMostLogit);
    }
  }
  return result;
}

std::vector<SoftMask> MasksOf(const PromptAnswers& answers, size_t first, size_t end,
                              const PromptedSegmenter& segmenter, cv::Size size) {
  std::vector<SoftMask> masks;
  for (size_t k = first; k < end; ++k) {
    masks.push_back(MaskOf(answers, k, segmenter.extent(), size));
  }
  return masks;
}

}  // namespace

absl::StatusOr<std::vector<SoftMask>> SegmentClicks(PromptedSegmenter& segmenter,
                                                    std::span<const PromptPoint> clicks,
                                                    const SoftMask* before, int width, int height) {
  const SegmenterPrompt points(clicks.begin(), clicks.end());
  PromptAnswers answers;
  if (before != nullptr) {
    MaskPrompt prompt = {points, std::nullopt, before->logits};
    if (prompt.logits.empty()) {
      prompt.logits = LogitsOfMask(before->mask, width, height, segmenter.extent());
    }
    ASSIGN_OR_RETURN(answers, segmenter.SegmentByMask(prompt));
  } else {
    ASSIGN_OR_RETURN(answers, segmenter.Segment({&points, 1}));
  }
  const bool is_open = before == nullptr && clicks.size() == 1;  // which thing is meant
  const bool is_settled = before == nullptr && !is_open;
  return MasksOf(answers, is_open ? 1 : 0, is_settled ? 1 : PromptAnswers::kMasks, segmenter,
                 {width, height});
}

absl::StatusOr<std::vector<SoftMask>> SegmentBox(PromptedSegmenter& segmenter,
                                                 const std::array<PromptPoint, 2>& box, int width,
                                                 int height) {
  ASSIGN_OR_RETURN(const PromptAnswers answers, segmenter.SegmentByMask({{}, box, {}}));
  return MasksOf(answers, 0, PromptAnswers::kMasks, segmenter, {width, height});
}

}  // namespace pepeseg
