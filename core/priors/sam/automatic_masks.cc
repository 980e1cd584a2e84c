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
        grid_(AnswerGrid(view.photo.width, view.photo.height, segmenter.extent())) {}

  // Prompts at the points, first at those that settled masks never make needless, and keeps the
  // masks that the segmenter proposes.
  absl::Status Propose(std::vector<PromptPoint> always, std::vector<PromptPoint> unsettled);
  // Prompts for the remainders of kept masks that hold other kept masks, and keeps good answers.
  absl::Status AskForRemainders();
  // Returns the kept masks at the photograph's size, then those of `embedded` unless it is null.
  absl::StatusOr<AutomaticMasks> Take(const MaskSet* embedded) const;

 private:
  ProposalRequest Request() const;
  PromptPoint CentreOf(const cv::Point& cell, bool positive) const;
  bool IsKept(const GridMask& mask) const;
  std::vector<TargetedPrompt> FindRemainders() const;

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

bool PhotographSegmenter::IsKept(const GridMask& mask) const {
  return std::any_of(kept_.begin(), kept_.end(), [&](const ProposedMask& other) {
    return mask.IsDuplicate(other.mask, kDuplicateMaskIou);
  });
}

// Looks at all ordered pairs of kept masks. A remainder is the outer one without the inner one; its
// prompt has two points in it and a negative one in the inner mask. A rest that is too small,
// nearly the whole outer mask, or already kept is left out, as is one with room for fewer than two
// points.
std::vector<TargetedPrompt> PhotographSegmenter::FindRemainders() const {
  constexpr double kInside = 0.9;    // share of the inner mask that the outer one holds
  constexpr double kMinShare = 0.1;  // smallest rest, as a share of the outer mask
  std::vector<TargetedPrompt> remainders;
  for (const ProposedMask& outer : kept_) {
    for (const ProposedMask& inner : kept_) {
      if (remainders.size() == kMaxRemainders) return remainders;
      const auto inner_area = static_cast<double>(inner.mask.area());
      if (&inner == &outer || inner.mask.area() >= outer.mask.area()) continue;
      if (static_cast<double>(inner.mask.Common(outer.mask)) < kInside * inner_area) continue;
      TargetedPrompt remainder = {{}, outer.mask.Without(inner.mask)};
      const double share =
          static_cast<double>(remainder.target.area()) / static_cast<double>(outer.mask.area());
      // The IoU of the rest with the outer mask is `share`, because the rest lies in it.
      if (share < kMinShare || share > kDuplicateMaskIou) continue;
      if (!Request().HasGoodArea(remainder.target.area()) || IsKept(remainder.target)) continue;
      const auto cells = DeepestCells(remainder.target.Image(grid_.width, grid_.height), 2);
      if (cells.size() < 2) continue;
      for (const cv::Point& cell : cells) remainder.prompt.push_back(CentreOf(cell, true));
      const auto out = DeepestCells(inner.mask.Image(grid_.width, grid_.height), 1);
      remainder.prompt.push_back(CentreOf(out[0], false));
      remainders.push_back(std::move(remainder));
    }
  }
  return remainders;
}

// Keeps, for each remainder, the answer with the highest IoU with it, if that exceeds
// min_remainder_iou.
absl::Status PhotographSegmenter::AskForRemainders() {
  // No answer can exceed an IoU of 1.
  if (options_.min_remainder_iou >= 1) return absl::OkStatus();
  const std::vector<TargetedPrompt> remainders = FindRemainders();
  if (remainders.empty()) return absl::OkStatus();
  ASSIGN_OR_RETURN(std::vector<ProposedMask> answers, segmenter_.Match(remainders, progress_));
  num_prompts_ += static_cast<int>(remainders.size());
  for (size_t i = 0; i < answers.size(); ++i) {
    const GridMask& mask = answers[i].mask;
    if (mask.area() == 0 || mask.Iou(remainders[i].target) <= options_.min_remainder_iou) continue;
    if (Request().HasGoodArea(mask.area()) && !IsKept(mask)) kept_.push_back(std::move(answers[i]));
  }
  return absl::OkStatus();
}

absl::StatusOr<AutomaticMasks> PhotographSegmenter::Take(const MaskSet* embedded) const {
  ASSIGN_OR_RETURN(const auto enlarged, segmenter_.Enlarge(kept_, view_));
  MaskSetBuilder builder(view_.photo.width, view_.photo.height, kDuplicateMaskIou);
  for (const std::vector<PixelRun>& runs : enlarged) builder.AddRuns(runs);
  MaskSet masks = std::move(builder).Build();
  if (embedded == nullptr) return AutomaticMasks{std::move(masks), num_prompts_};
  return AutomaticMasks{JoinMasks(masks, *embedded, view_.ignore), num_prompts_};
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
  // The first of duplicate masks stays: those of `first` win.
  for (const MaskSet* set : {&first, &second}) {
    for (const std::vector<PixelRun>& runs : RunsOfMasks(*set, ignore)) builder.AddRuns(runs);
  }
  return std::move(builder).Build();
}

}  // namespace pepeseg
