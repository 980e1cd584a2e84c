#include "core/priors/sam/automatic_masks.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "core/base/status_macros.h"
#include "core/priors/sam/grid_mask.h"
#include "core/priors/sam/joined_masks.h"
#include "core/priors/sam/prompt_points.h"

namespace pepeseg {
namespace {

// A mask of one answer. Logits are kept in quarters: finer differences move no border by a pixel.
struct Candidate {
  GridMask mask;
  float iou = 0, stability = 0;
  size_t cell = 0;  // of the point that was asked about
  std::vector<int8_t> quarter_logits;
};

class PhotographSegmenter {
 public:
  PhotographSegmenter(PromptedSegmenter& segmenter, const View& view,
                      const AutomaticMaskOptions& options,
                      absl::FunctionRef<absl::Status()> progress)
      : segmenter_(segmenter),
        view_(view),
        options_(options),
        progress_(progress),
        grid_(AnswerGrid(view.photo.width, view.photo.height)),
        settled_(num_cells()) {}

  absl::Status Ask(const std::vector<PromptPoint>& points, bool skip_settled);
  void KeepSure();
  void KeepFillers();
  absl::Status AskForRemainders();
  AutomaticMasks Take(const MaskSet* embedded) const;

 private:
  struct Remainder {
    GridMask rest;
    SegmenterPrompt prompt;
  };

  size_t num_cells() const { return static_cast<size_t>(grid_.width) * grid_.height; }
  size_t CellOf(const PromptPoint& point) const;
  PromptPoint CentreOf(const cv::Point& cell, bool positive) const;
  absl::StatusOr<PromptAnswers> Run(std::span<const SegmenterPrompt> prompts);
  absl::Status AskBatch(std::span<const SegmenterPrompt> prompts);
  Candidate Read(const PromptAnswers& answers, size_t prompt, size_t mask) const;
  bool HasGoodArea(const GridMask& mask) const;
  bool IsSure(const Candidate& candidate) const;
  bool IsKept(const GridMask& mask) const;
  std::vector<Remainder> FindRemainders() const;
  void TakeRemainders(const PromptAnswers& answers, std::span<const Remainder> remainders);
  std::vector<uint32_t> PixelsOf(const Candidate& candidate) const;

  PromptedSegmenter& segmenter_;
  const View& view_;
  const AutomaticMaskOptions& options_;
  absl::FunctionRef<absl::Status()> progress_;
  const PromptAnswers grid_;
  std::vector<Candidate> candidates_, kept_;
  std::vector<uint8_t> settled_;  // [cells] whether a small sure mask holds it
  int num_prompts_ = 0;
};

size_t PhotographSegmenter::CellOf(const PromptPoint& point) const {
  const auto cell = [&](float at, int count) {
    return std::clamp(static_cast<int>(at * grid_.cells_per_pixel), 0, count - 1);
  };
  return static_cast<size_t>(cell(point.y, grid_.height)) * grid_.width +
         cell(point.x, grid_.width);
}

PromptPoint PhotographSegmenter::CentreOf(const cv::Point& cell, bool positive) const {
  const auto centre = [&](int at) {
    return static_cast<float>((at + 0.5) / grid_.cells_per_pixel);
  };
  return {centre(cell.x), centre(cell.y), positive};
}

absl::StatusOr<PromptAnswers> PhotographSegmenter::Run(std::span<const SegmenterPrompt> prompts) {
  RETURN_IF_ERROR(progress_());
  num_prompts_ += static_cast<int>(prompts.size());
  return segmenter_.Segment(prompts);
}

bool PhotographSegmenter::HasGoodArea(const GridMask& mask) const {
  const double share = static_cast<double>(mask.area()) / static_cast<double>(num_cells());
  return mask.area() > 0 && share >= options_.min_area && share <= options_.max_area;
}

bool PhotographSegmenter::IsSure(const Candidate& candidate) const {
  return candidate.iou >= options_.min_iou && candidate.stability >= options_.min_stability;
}

Candidate PhotographSegmenter::Read(const PromptAnswers& answers, size_t prompt,
                                    size_t mask) const {
  const std::span<const float> logits = answers.Logits(prompt, mask);
  const auto offset = static_cast<float>(options_.stability_offset);
  Candidate candidate;
  candidate.mask = GridMask(logits, 0);
  candidate.iou = answers.Iou(prompt, mask);
  const GridMask wide(logits, -offset);
  if (wide.area() > 0) {
    candidate.stability =
        static_cast<float>(GridMask(logits, offset).area()) / static_cast<float>(wide.area());
  }
  return candidate;
}

std::vector<int8_t> QuarterLogits(std::span<const float> logits) {
  std::vector<int8_t> quarters;
  quarters.reserve(logits.size());
  for (const float logit : logits) {
    quarters.push_back(static_cast<int8_t>(std::lround(std::clamp(logit * 4, -127.0F, 127.0F))));
  }
  return quarters;
}

absl::Status PhotographSegmenter::AskBatch(std::span<const SegmenterPrompt> prompts) {
  ASSIGN_OR_RETURN(const PromptAnswers answers, Run(prompts));
  for (size_t prompt = 0; prompt < prompts.size(); ++prompt) {
    // Mask 0 is what several points mean.
    for (size_t mask = 1; mask < PromptAnswers::kMasks; ++mask) {
      if (answers.Iou(prompt, mask) < options_.min_filler_iou) continue;
      Candidate candidate = Read(answers, prompt, mask);
      if (candidate.stability < options_.min_filler_stability) continue;
      if (!HasGoodArea(candidate.mask)) continue;
      candidate.cell = CellOf(prompts[prompt][0]);
      candidate.quarter_logits = QuarterLogits(answers.Logits(prompt, mask));
      const bool small = static_cast<double>(candidate.mask.area()) <
                         options_.settled_area * static_cast<double>(num_cells());
      for (size_t cell = 0; small && IsSure(candidate) && cell < num_cells(); ++cell) {
        settled_[cell] |= static_cast<uint8_t>(candidate.mask.Holds(cell));
      }
      candidates_.push_back(std::move(candidate));
    }
  }
  return absl::OkStatus();
}

absl::Status PhotographSegmenter::Ask(const std::vector<PromptPoint>& points, bool skip_settled) {
  std::vector<SegmenterPrompt> batch;
  for (size_t i = 0; i < points.size(); ++i) {
    const size_t cell = CellOf(points[i]);
    if (!skip_settled || settled_[cell] == 0) batch.push_back({points[i]});
    const bool full = static_cast<int>(batch.size()) == options_.prompts_per_run;
    if (batch.empty() || (!full && i + 1 < points.size())) continue;
    RETURN_IF_ERROR(AskBatch(batch));
    batch.clear();
  }
  return absl::OkStatus();
}

bool PhotographSegmenter::IsKept(const GridMask& mask) const {
  return std::any_of(kept_.begin(), kept_.end(), [&](const Candidate& other) {
    return mask.Iou(other.mask) > options_.duplicate_iou;
  });
}

void PhotographSegmenter::KeepSure() {
  std::stable_sort(candidates_.begin(), candidates_.end(),
                   [](const Candidate& a, const Candidate& b) { return a.iou > b.iou; });
  std::vector<Candidate> rest;
  for (Candidate& candidate : candidates_) {
    if (!IsSure(candidate)) {
      rest.push_back(std::move(candidate));
    } else if (!IsKept(candidate.mask)) {
      kept_.push_back(std::move(candidate));
    }
  }
  candidates_ = std::move(rest);
}

// Less sure masks, the best first, where nothing is kept yet.
void PhotographSegmenter::KeepFillers() {
  for (Candidate& candidate : candidates_) {
    const bool held = std::any_of(kept_.begin(), kept_.end(), [&](const Candidate& other) {
      return other.mask.Holds(candidate.cell);
    });
    if (!held && !IsKept(candidate.mask)) kept_.push_back(std::move(candidate));
  }
  candidates_.clear();
}

std::vector<PhotographSegmenter::Remainder> PhotographSegmenter::FindRemainders() const {
  constexpr double kInside = 0.9;    // share of a mask that another one holds
  constexpr double kMinShare = 0.1;  // that the rest is of the outer mask
  std::vector<Remainder> remainders;
  for (const Candidate& outer : kept_) {
    for (const Candidate& inner : kept_) {
      if (static_cast<int>(remainders.size()) == options_.max_remainders) return remainders;
      const auto inner_area = static_cast<double>(inner.mask.area());
      if (&inner == &outer || inner.mask.area() >= outer.mask.area()) continue;
      if (static_cast<double>(inner.mask.Common(outer.mask)) < kInside * inner_area) continue;
      Remainder remainder = {outer.mask.Without(inner.mask), {}};
      const double share =
          static_cast<double>(remainder.rest.area()) / static_cast<double>(outer.mask.area());
      if (share < kMinShare || share > options_.duplicate_iou) continue;
      if (!HasGoodArea(remainder.rest) || IsKept(remainder.rest)) continue;
      const auto cells = DeepestCells(remainder.rest.Image(grid_.width, grid_.height), 2);
      if (cells.size() < 2) continue;
      for (const cv::Point& cell : cells) remainder.prompt.push_back(CentreOf(cell, true));
      const auto out = DeepestCells(inner.mask.Image(grid_.width, grid_.height), 1);
      remainder.prompt.push_back(CentreOf(out[0], false));
      remainders.push_back(std::move(remainder));
    }
  }
  return remainders;
}

void PhotographSegmenter::TakeRemainders(const PromptAnswers& answers,
                                         std::span<const Remainder> remainders) {
  for (size_t prompt = 0; prompt < remainders.size(); ++prompt) {
    double best_iou = options_.min_remainder_iou;
    Candidate best;
    for (size_t mask = 0; mask < PromptAnswers::kMasks; ++mask) {
      Candidate candidate = Read(answers, prompt, mask);
      const double iou = candidate.mask.Iou(remainders[prompt].rest);
      if (iou <= best_iou) continue;
      best_iou = iou;
      best = std::move(candidate);
      best.quarter_logits = QuarterLogits(answers.Logits(prompt, mask));
    }
    if (HasGoodArea(best.mask) && !IsKept(best.mask)) kept_.push_back(std::move(best));
  }
}

absl::Status PhotographSegmenter::AskForRemainders() {
  if (options_.min_remainder_iou >= 1) return absl::OkStatus();
  const std::vector<Remainder> remainders = FindRemainders();
  const std::span<const Remainder> all = remainders;
  const auto at_once = static_cast<size_t>(options_.prompts_per_run);
  for (size_t first = 0; first < all.size(); first += at_once) {
    const auto batch = all.subspan(first, std::min(at_once, all.size() - first));
    std::vector<SegmenterPrompt> prompts;
    for (const Remainder& remainder : batch) prompts.push_back(remainder.prompt);
    ASSIGN_OR_RETURN(const PromptAnswers answers, Run(prompts));
    TakeRemainders(answers, batch);
  }
  return absl::OkStatus();
}

std::vector<uint32_t> Pixels(const cv::Mat& inside, const View& view) {
  std::vector<uint32_t> pixels;
  for (int y = 0; y < inside.rows; ++y) {
    for (int x = 0; x < inside.cols; ++x) {
      const size_t pixel = static_cast<size_t>(y) * inside.cols + x;
      if (!view.ignore.empty() && view.ignore[pixel] != 0) continue;
      if (inside.at<uint8_t>(y, x) != 0) pixels.push_back(static_cast<uint32_t>(pixel));
    }
  }
  return pixels;
}

// Logits are interpolated between the centres of the cells, as the network's own masks are.
std::vector<uint32_t> PhotographSegmenter::PixelsOf(const Candidate& candidate) const {
  cv::Mat logits(grid_.height, grid_.width, CV_32F);
  for (int y = 0; y < grid_.height; ++y) {
    for (int x = 0; x < grid_.width; ++x) {
      logits.at<float>(y, x) = candidate.quarter_logits[static_cast<size_t>(y) * grid_.width + x];
    }
  }
  const double scale = grid_.cells_per_pixel, shift = 0.5 * scale - 0.5;
  const cv::Matx23d cell_from_pixel(scale, 0, shift, 0, scale, shift);
  cv::Mat pixels;
  cv::warpAffine(logits, pixels, cell_from_pixel, {view_.photo.width, view_.photo.height},
                 cv::INTER_LINEAR | cv::WARP_INVERSE_MAP, cv::BORDER_REPLICATE);
  return Pixels(pixels > 0, view_);
}

AutomaticMasks PhotographSegmenter::Take(const MaskSet* embedded) const {
  MaskSetBuilder builder(view_.photo.width, view_.photo.height, options_.duplicate_iou);
  for (const Candidate& candidate : kept_) builder.Add(PixelsOf(candidate));
  MaskSet masks = std::move(builder).Build();
  if (embedded == nullptr) return {std::move(masks), num_prompts_};
  return {JoinMasks(masks, *embedded, view_.ignore, options_.duplicate_iou), num_prompts_};
}

}  // namespace

absl::StatusOr<AutomaticMasks> SegmentPhotograph(PromptedSegmenter& segmenter, const View& view,
                                                 const MaskSet& embedded,
                                                 const AutomaticMaskOptions& options,
                                                 absl::FunctionRef<absl::Status()> progress) {
  RETURN_IF_ERROR(progress());
  RETURN_IF_ERROR(segmenter.SetPhotograph(view.photo));
  PhotographSegmenter run(segmenter, view, options, progress);
  if (options.region_points) {
    RETURN_IF_ERROR(run.Ask(RegionPoints(embedded), /*skip_settled=*/false));
  }
  RETURN_IF_ERROR(run.Ask(GridPoints(view.photo, options.points_per_side), /*skip_settled=*/true));
  run.KeepSure();
  run.KeepFillers();
  RETURN_IF_ERROR(run.AskForRemainders());
  return run.Take(options.join_embedded ? &embedded : nullptr);
}

}  // namespace pepeseg
