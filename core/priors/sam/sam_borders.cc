#include "core/priors/sam/sam_borders.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <opencv2/imgproc.hpp>
#include <span>
#include <utility>
#include <vector>

#include "core/base/status_macros.h"
#include "core/priors/sam/grid_mask.h"
#include "core/priors/sam/mask_logits.h"

namespace pepeseg {
namespace {

constexpr int kMostPoints = 3;  // inside the mask, the deepest ones
// Returns the prompt for a mask: its deepest points, its box and the mask itself, on a grid of
// `extent` cells a side.
MaskPrompt PromptOf(const cv::Mat& mask, const cv::Mat& distance, const PromptAnswers& grid,
                    int extent) {
  MaskPrompt prompt;
  const auto at = [](double x, double y) {
    return PromptPoint{static_cast<float>(x), static_cast<float>(y), true};
  };
  for (const cv::Point& pixel : DeepestCells(mask, kMostPoints)) {
    prompt.points.push_back(at(pixel.x + 0.5, pixel.y + 0.5));
  }
  const cv::Rect box = cv::boundingRect(mask);
  prompt.box = {at(box.x, box.y), at(box.br().x, box.br().y)};

  prompt.logits = LogitsOfDistance(distance, grid, extent);
  return prompt;
}

double IouOf(const cv::Mat& a, const cv::Mat& b) {
  const int common = cv::countNonZero(a & b), united = cv::countNonZero(a | b);
  return united == 0 ? 0 : static_cast<double>(common) / united;
}

}  // namespace

// The first of the decoder's four masks is the one for prompts that leave no doubt which thing is
// meant (Kirillov et al. 2023, "Segment Anything").
absl::StatusOr<BinaryMask> RefineMask(PromptedSegmenter& segmenter, const BinaryMask& mask,
                                      int width, int height, const RefineLimits& limits) {
  const cv::Mat before(height, width, CV_8U, const_cast<uint8_t*>(mask.pixels.data()));
  const int area = cv::countNonZero(before);
  if (area == 0 || area == width * height) return mask;  // no border
  const int extent = segmenter.extent();
  const PromptAnswers grid = AnswerGrid(width, height, extent);
  const cv::Mat distance = SignedDistance(before);
  ASSIGN_OR_RETURN(const PromptAnswers answers,
                   segmenter.SegmentByMask(PromptOf(before, distance, grid, extent)));
  const std::span<const float> first = answers.Logits(0, 0);
  const cv::Mat cells(grid.height, grid.width, CV_32F, const_cast<float*>(first.data()));
  const cv::Mat seen = PixelsInside(cells, grid.cells_per_pixel, before.size()) / 255;
  if (IouOf(seen, before) < limits.same_thing) return mask;
  BinaryMask refined = mask;
  cv::Mat after(height, width, CV_8U, refined.pixels.data());
  seen.copyTo(after, cv::abs(distance) <= limits.reach * std::hypot(width, height));
  return refined;
}

absl::StatusOr<std::unique_ptr<SamBorders>> SamBorders::Open(const std::filesystem::path& folder,
                                                             SamOptions options) {
  options.mask_prompts = true;
  ASSIGN_OR_RETURN(auto model, SamModel::Open(folder, options));
  return std::unique_ptr<SamBorders>(new SamBorders(std::move(model)));
}

absl::StatusOr<SamEmbedding> SamBorders::Embed(const Image& image) const {
  const auto segmenter = model_->MakeSegmenter();
  RETURN_IF_ERROR(segmenter->SetPhotograph(image));
  return segmenter->Embedding();
}

absl::StatusOr<BinaryMask> SamBorders::Refine(const SamEmbedding& embedding, const BinaryMask& mask,
                                              const RefineLimits& limits) const {
  const auto segmenter = model_->MakeSegmenter();
  RETURN_IF_ERROR(segmenter->SetEmbedding(embedding));
  return RefineMask(*segmenter, mask, embedding.width, embedding.height, limits);
}

absl::StatusOr<std::vector<SoftMask>> SamBorders::Click(const SamEmbedding& embedding,
                                                        std::span<const PromptPoint> clicks,
                                                        const SoftMask* before) const {
  const auto segmenter = model_->MakeSegmenter();
  RETURN_IF_ERROR(segmenter->SetEmbedding(embedding));
  return SegmentClicks(*segmenter, clicks, before, embedding.width, embedding.height);
}

absl::StatusOr<std::vector<SoftMask>> SamBorders::Box(const SamEmbedding& embedding,
                                                      const std::array<PromptPoint, 2>& box) const {
  const auto segmenter = model_->MakeSegmenter();
  RETURN_IF_ERROR(segmenter->SetEmbedding(embedding));
  return SegmentBox(*segmenter, box, embedding.width, embedding.height);
}

}  // namespace pepeseg
