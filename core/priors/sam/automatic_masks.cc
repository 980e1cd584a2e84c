#include "core/priors/sam/automatic_masks.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "core/base/status_macros.h"
#include "core/priors/sam/grid_mask.h"
#include "core/priors/sam/mask_proposals.h"

namespace pepeseg {
namespace {

constexpr size_t kMaxRemainders = 32;  // most remainders of a photograph

// The segmentation of one photograph: Propose and AskForRemainders move good masks to kept_, in
// this order; Take returns them at the photograph's size.
class PhotographSegmenter {
 public:
  PhotographSegmenter(PromptedSegmenter& segmenter, const View& view,
                      const AutomaticMaskOptions& options,
                      absl::FunctionRef<absl::Status()> progress)
      : segmenter_(segmenter),
        view_(view),
        options_(options),
        progress_(progress),
        grid_(AnswerGrid(view.photo.width, view.photo.height)) {}

  // Prompts at the points, first at those that settled masks never make needless, and keeps the
  // masks that the segmenter proposes.
  absl::Status Propose(std::vector<PromptPoint> always, std::vector<PromptPoint> unsettled);
  // Prompts for the remainders of kept masks that hold other kept masks, and keeps good answers.
  absl::Status AskForRemainders();
  // Returns the kept masks at the photograph's size, then those of `embedded` unless it is null.
  AutomaticMasks Take(const MaskSet* embedded) const;

 private:
  struct Remainder {
    GridMask rest;           // the outer mask without the inner one
    SegmenterPrompt prompt;  // two points in the rest, and a negative one in the inner mask
  };

  ProposalRequest Request() const;
  PromptPoint CentreOf(const cv::Point& cell, bool positive) const;
  absl::StatusOr<PromptAnswers> Run(std::span<const SegmenterPrompt> prompts);
  bool IsKept(const GridMask& mask) const;
  std::vector<Remainder> FindRemainders() const;
  void TakeRemainders(const PromptAnswers& answers, std::span<const Remainder> remainders);

  PromptedSegmenter& segmenter_;
  const View& view_;
  const AutomaticMaskOptions& options_;
  absl::FunctionRef<absl::Status()> progress_;
  const PromptAnswers grid_;
  std::vector<ProposedMask> kept_;
  int num_prompts_ = 0;
};

ProposalRequest PhotographSegmenter::Request() const {
  ProposalRequest request;
  request.grid = grid_;
  request.settled_area = options_.settled_area;
  request.min_iou = options_.min_iou;
  request.min_stability = options_.min_stability;
  request.min_filler_iou = options_.min_filler_iou;
  request.min_filler_stability = options_.min_filler_stability;
  return request;
}

absl::Status PhotographSegmenter::Propose(std::vector<PromptPoint> always,
                                          std::vector<PromptPoint> unsettled) {
  ProposalRequest request = Request();
  request.always = std::move(always);
  request.unsettled = std::move(unsettled);
  ASSIGN_OR_RETURN(Proposals proposals, segmenter_.Propose(request, progress_));
  num_prompts_ += proposals.num_prompts;
  kept_ = std::move(proposals.kept);
  return absl::OkStatus();
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

bool PhotographSegmenter::IsKept(const GridMask& mask) const {
  return std::any_of(kept_.begin(), kept_.end(), [&](const ProposedMask& other) {
    return mask.Iou(other.mask) > kDuplicateMaskIou;
  });
}

// Looks at all ordered pairs of kept masks. A rest that is too small, nearly the whole outer mask,
// or already kept is left out, as is one with room for fewer than two points.
std::vector<PhotographSegmenter::Remainder> PhotographSegmenter::FindRemainders() const {
  constexpr double kInside = 0.9;    // share of the inner mask that the outer one holds
  constexpr double kMinShare = 0.1;  // smallest rest, as a share of the outer mask
  std::vector<Remainder> remainders;
  for (const ProposedMask& outer : kept_) {
    for (const ProposedMask& inner : kept_) {
      if (remainders.size() == kMaxRemainders) return remainders;
      const auto inner_area = static_cast<double>(inner.mask.area());
      if (&inner == &outer || inner.mask.area() >= outer.mask.area()) continue;
      if (static_cast<double>(inner.mask.Common(outer.mask)) < kInside * inner_area) continue;
      Remainder remainder = {outer.mask.Without(inner.mask), {}};
      const double share =
          static_cast<double>(remainder.rest.area()) / static_cast<double>(outer.mask.area());
      // The IoU of the rest with the outer mask is `share`, because the rest lies in it.
      if (share < kMinShare || share > kDuplicateMaskIou) continue;
      if (!Request().HasGoodArea(remainder.rest.area()) || IsKept(remainder.rest)) continue;
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

// Keeps, for each remainder, the answer with the highest IoU with the rest, if that exceeds
// min_remainder_iou.
void PhotographSegmenter::TakeRemainders(const PromptAnswers& answers,
                                         std::span<const Remainder> remainders) {
  for (size_t prompt = 0; prompt < remainders.size(); ++prompt) {
    double best_iou = options_.min_remainder_iou;
    ProposedMask best;
    for (size_t mask = 0; mask < PromptAnswers::kMasks; ++mask) {
      ProposedMask candidate = ReadMask(answers, prompt, mask);
      const double iou = candidate.mask.Iou(remainders[prompt].rest);
      if (iou <= best_iou) continue;
      best_iou = iou;
      best = std::move(candidate);
      best.quarter_logits = QuarterLogits(answers.Logits(prompt, mask));
    }
    if (Request().HasGoodArea(best.mask.area()) && !IsKept(best.mask))
      kept_.push_back(std::move(best));
  }
}

absl::Status PhotographSegmenter::AskForRemainders() {
  // No answer can exceed an IoU of 1.
  if (options_.min_remainder_iou >= 1) return absl::OkStatus();
  const std::vector<Remainder> remainders = FindRemainders();
  const std::span<const Remainder> all = remainders;
  for (size_t first = 0; first < all.size(); first += kPromptsPerRun) {
    const auto batch = all.subspan(first, std::min(kPromptsPerRun, all.size() - first));
    std::vector<SegmenterPrompt> prompts;
    for (const Remainder& remainder : batch) prompts.push_back(remainder.prompt);
    ASSIGN_OR_RETURN(const PromptAnswers answers, Run(prompts));
    TakeRemainders(answers, batch);
  }
  return absl::OkStatus();
}

AutomaticMasks PhotographSegmenter::Take(const MaskSet* embedded) const {
  MaskSetBuilder builder(view_.photo.width, view_.photo.height, kDuplicateMaskIou);
  for (const ProposedMask& candidate : kept_) {
    builder.Add(PixelsOfLogits(candidate.quarter_logits, grid_, view_));
  };
  MaskSet masks = std::move(builder).Build();
  if (embedded == nullptr) return {std::move(masks), num_prompts_};
  return {JoinMasks(masks, *embedded, view_.ignore), num_prompts_};
}

}  // namespace

absl::StatusOr<AutomaticMasks> SegmentPhotograph(PromptedSegmenter& segmenter, const View& view,
                                                 const MaskSet& embedded,
                                                 const AutomaticMaskOptions& options,
                                                 absl::FunctionRef<absl::Status()> progress) {
  // METHOD.md section 6: regions of the built-in method first, then a grid of points; sure masks,
  // fillers, remainders.
  RETURN_IF_ERROR(progress());
  RETURN_IF_ERROR(segmenter.SetPhotograph(view.photo));
  PhotographSegmenter run(segmenter, view, options, progress);
  RETURN_IF_ERROR(
      run.Propose(options.region_points ? RegionPoints(embedded) : std::vector<PromptPoint>(),
                  GridPoints(view.photo, options.points_per_side)));
  RETURN_IF_ERROR(run.AskForRemainders());
  return run.Take(options.join_embedded ? &embedded : nullptr);
}

MaskSet JoinMasks(const MaskSet& first, const MaskSet& second, std::span<const uint8_t> ignore) {
  MaskSetBuilder builder(first.width, first.height, kDuplicateMaskIou);
  // Of duplicates the mask that was added first stays: those of `first` win.
  for (const MaskSet* set : {&first, &second}) {
    for (int k = 0; k < set->num_masks; ++k) {
      const BinaryMask mask = set->Extract(k);
      std::vector<uint32_t> pixels;
      for (size_t i = 0; i < mask.pixels.size(); ++i) {
        const bool ignored = !ignore.empty() && ignore[i] != 0;
        if (mask.pixels[i] != 0 && !ignored) pixels.push_back(static_cast<uint32_t>(i));
      }
      builder.Add(pixels);
    }
  }
  return std::move(builder).Build();
}

}  // namespace pepeseg
