#include "core/priors/sam/automatic_masks.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "core/base/status_macros.h"
#include "core/priors/sam/grid_mask.h"

namespace pepeseg {
namespace {

constexpr float kStabilityOffset = 1;  // logits, see AutomaticMaskOptions::min_stability
constexpr double kDuplicateIou = 0.8;  // IoU with a better mask over which a mask is dropped
constexpr size_t kMaxRemainders = 32;  // most remainders of a photograph
constexpr double kMinArea = 0.0005;    // smallest mask, as a share of the photograph
constexpr double kMaxArea = 0.95;      // largest mask, as a share of the photograph
constexpr size_t kPromptsPerRun = 4;   // most prompts of one run of the segmenter

// A mask that the segmenter answered with.
struct Candidate {
  GridMask mask;
  float iou = 0, stability = 0;        // see AutomaticMaskOptions::min_iou
  size_t cell = 0;                     // cell of the prompt's point
  std::vector<int8_t> quarter_logits;  // [height, width], see QuarterLogits
};

// The segmentation of one photograph: Ask collects candidates; KeepSure, KeepFillers and
// AskForRemainders move the good ones to kept_, in this order; Take returns them as masks.
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

  // Prompts at each point and collects the candidates. skip_settled: not at points that a small
  // sure mask already holds.
  absl::Status Ask(const std::vector<PromptPoint>& points, bool skip_settled);
  // Keeps the sure candidates, those with the highest IoU first, without duplicates.
  void KeepSure();
  // Keeps the other candidates, the best first, whose point no kept mask holds. Drops the rest.
  void KeepFillers();
  // Prompts for the remainders of kept masks that hold other kept masks, and keeps good answers.
  absl::Status AskForRemainders();
  // Returns the kept masks at the photograph's size, then those of `embedded` unless it is null.
  AutomaticMasks Take(const MaskSet* embedded) const;

 private:
  struct Remainder {
    GridMask rest;           // the outer mask without the inner one
    SegmenterPrompt prompt;  // two points in the rest, and a negative one in the inner mask
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

  PromptedSegmenter& segmenter_;
  const View& view_;
  const AutomaticMaskOptions& options_;
  absl::FunctionRef<absl::Status()> progress_;
  const PromptAnswers grid_;
  std::vector<Candidate> candidates_, kept_;
  std::vector<uint8_t> settled_;  // [cells] 1: a small sure mask holds the cell
  int num_prompts_ = 0;
};

size_t PhotographSegmenter::CellOf(const PromptPoint& point) const {
  const auto cell = [&](float at, int count) {
    return std::clamp(static_cast<int>(at * grid_.cells_per_pixel), 0, count - 1);
  };
  // Points are in pixels of the photograph, the first pixel's centre at 0.5; cells follow in
  // reading order.
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
  // Shares of the grid, which covers the whole photograph.
  return mask.area() > 0 && share >= kMinArea && share <= kMaxArea;
}

bool PhotographSegmenter::IsSure(const Candidate& candidate) const {
  return candidate.iou >= options_.min_iou && candidate.stability >= options_.min_stability;
}

Candidate PhotographSegmenter::Read(const PromptAnswers& answers, size_t prompt,
                                    size_t mask) const {
  const std::span<const float> logits = answers.Logits(prompt, mask);
  Candidate candidate;
  candidate.mask = GridMask(logits, 0);
  candidate.iou = answers.Iou(prompt, mask);
  // Stability as in SAM: the area at the threshold +kStabilityOffset over that at
  // -kStabilityOffset.
  const GridMask wide(logits, -kStabilityOffset);
  if (wide.area() > 0) {
    candidate.stability = static_cast<float>(GridMask(logits, kStabilityOffset).area()) /
                          static_cast<float>(wide.area());
  }
  return candidate;
}

absl::Status PhotographSegmenter::AskBatch(std::span<const SegmenterPrompt> prompts) {
  ASSIGN_OR_RETURN(const PromptAnswers answers, Run(prompts));
  for (size_t prompt = 0; prompt < prompts.size(); ++prompt) {
    // Mask 0 is for prompts of several points.
    for (size_t mask = 1; mask < PromptAnswers::kMasks; ++mask) {
      if (answers.Iou(prompt, mask) < options_.min_filler_iou) continue;
      Candidate candidate = Read(answers, prompt, mask);
      if (candidate.stability < options_.min_filler_stability) continue;
      if (!HasGoodArea(candidate.mask)) continue;
      candidate.cell = CellOf(prompts[prompt][0]);
      // A byte a cell: the candidates of a photograph are kept in memory together.
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
    const bool full = batch.size() == kPromptsPerRun;
    if (batch.empty() || (!full && i + 1 < points.size())) continue;
    RETURN_IF_ERROR(AskBatch(batch));
    batch.clear();
  }
  return absl::OkStatus();
}

bool PhotographSegmenter::IsKept(const GridMask& mask) const {
  return std::any_of(kept_.begin(), kept_.end(),
                     [&](const Candidate& other) { return mask.Iou(other.mask) > kDuplicateIou; });
}

void PhotographSegmenter::KeepSure() {
  // Stable, so that answers with equal IoUs keep the order of the prompts and the result is the
  // same in each run.
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

// KeepSure has sorted the candidates that are left.
void PhotographSegmenter::KeepFillers() {
  for (Candidate& candidate : candidates_) {
    const bool held = std::any_of(kept_.begin(), kept_.end(), [&](const Candidate& other) {
      return other.mask.Holds(candidate.cell);
    });
    // A filler only covers what no better mask does: its own prompt's point must be free.
    if (!held && !IsKept(candidate.mask)) kept_.push_back(std::move(candidate));
  }
  candidates_.clear();
}

// Looks at all ordered pairs of kept masks. A rest that is too small, nearly the whole outer mask,
// or already kept is left out, as is one with room for fewer than two points.
std::vector<PhotographSegmenter::Remainder> PhotographSegmenter::FindRemainders() const {
  constexpr double kInside = 0.9;    // share of the inner mask that the outer one holds
  constexpr double kMinShare = 0.1;  // smallest rest, as a share of the outer mask
  std::vector<Remainder> remainders;
  for (const Candidate& outer : kept_) {
    for (const Candidate& inner : kept_) {
      if (remainders.size() == kMaxRemainders) return remainders;
      const auto inner_area = static_cast<double>(inner.mask.area());
      if (&inner == &outer || inner.mask.area() >= outer.mask.area()) continue;
      if (static_cast<double>(inner.mask.Common(outer.mask)) < kInside * inner_area) continue;
      Remainder remainder = {outer.mask.Without(inner.mask), {}};
      const double share =
          static_cast<double>(remainder.rest.area()) / static_cast<double>(outer.mask.area());
      // The IoU of the rest with the outer mask is `share`, because the rest lies in it.
      if (share < kMinShare || share > kDuplicateIou) continue;
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

// Keeps, for each remainder, the answer with the highest IoU with the rest, if that exceeds
// min_remainder_iou.
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
  MaskSetBuilder builder(view_.photo.width, view_.photo.height, kDuplicateIou);
  for (const Candidate& candidate : kept_) {
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
  if (options.region_points) {
    RETURN_IF_ERROR(run.Ask(RegionPoints(embedded), /*skip_settled=*/false));
  }
  RETURN_IF_ERROR(run.Ask(GridPoints(view.photo, options.points_per_side), /*skip_settled=*/true));
  run.KeepSure();
  run.KeepFillers();
  RETURN_IF_ERROR(run.AskForRemainders());
  return run.Take(options.join_embedded ? &embedded : nullptr);
}

MaskSet JoinMasks(const MaskSet& first, const MaskSet& second, std::span<const uint8_t> ignore) {
  MaskSetBuilder builder(first.width, first.height, kDuplicateIou);
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
