#include "core/priors/sam/mask_proposals.h"

#include <algorithm>
#include <utility>

#include "core/base/status_macros.h"

namespace pepeseg {
namespace {

// Mask 0 is for prompts of several points.
constexpr size_t kFirstMask = 1;

// Asks by Segment, then chooses.
class HostProposals {
 public:
  HostProposals(PromptedSegmenter& segmenter, const ProposalRequest& request,
                absl::FunctionRef<absl::Status()> progress)
      : segmenter_(segmenter),
        request_(request),
        progress_(progress),
        settled_(static_cast<size_t>(request.grid.width) * request.grid.height) {}

  // Prompts at each point and collects the candidates. skip_settled: not at points that a small
  // sure mask already holds.
  absl::Status Ask(const std::vector<PromptPoint>& points, bool skip_settled) {
    std::vector<SegmenterPrompt> batch;
    for (size_t i = 0; i < points.size(); ++i) {
      const size_t cell = request_.CellOf(points[i]);
      if (!skip_settled || settled_[cell] == 0) batch.push_back({points[i]});
      const bool full = batch.size() == kPromptsPerRun;
      if (batch.empty() || (!full && i + 1 < points.size())) continue;
      RETURN_IF_ERROR(AskBatch(batch));
      batch.clear();
    }
    return absl::OkStatus();
  }

  // Keeps the sure candidates, those with the highest IoU first, without duplicates; then the
  // others whose point no kept mask holds.
  Proposals Choose() && {
    // Stable, so that answers with equal IoUs keep the order of the prompts and the result is the
    // same in each run.
    std::stable_sort(candidates_.begin(), candidates_.end(),
                     [](const ProposedMask& a, const ProposedMask& b) { return a.iou > b.iou; });
    std::vector<ProposedMask> fillers;
    for (ProposedMask& candidate : candidates_) {
      if (!request_.IsSure(candidate)) {
        fillers.push_back(std::move(candidate));
      } else if (!IsKept(candidate.mask)) {
        proposals_.kept.push_back(std::move(candidate));
      }
    }
    for (ProposedMask& filler : fillers) {
      const auto& kept = proposals_.kept;
      const bool held = std::any_of(kept.begin(), kept.end(), [&](const ProposedMask& other) {
        return other.mask.Holds(filler.cell);
      });
      // A filler only covers what no better mask does: its own prompt's point must be free.
      if (!held && !IsKept(filler.mask)) proposals_.kept.push_back(std::move(filler));
    }
    return std::move(proposals_);
  }

 private:
  absl::Status AskBatch(std::span<const SegmenterPrompt> prompts) {
    RETURN_IF_ERROR(progress_());
    proposals_.num_prompts += static_cast<int>(prompts.size());
    ASSIGN_OR_RETURN(const PromptAnswers answers, segmenter_.Segment(prompts));
    for (size_t prompt = 0; prompt < prompts.size(); ++prompt) {
      for (size_t mask = kFirstMask; mask < PromptAnswers::kMasks; ++mask) {
        if (answers.Iou(prompt, mask) < request_.min_filler_iou) continue;
        ProposedMask candidate = ReadMask(answers, prompt, mask);
        if (candidate.stability < request_.min_filler_stability) continue;
        if (!request_.HasGoodArea(candidate.mask.area())) continue;
        candidate.cell = request_.CellOf(prompts[prompt][0]);
        // A byte a cell: the candidates of a photograph are kept in memory together.
        candidate.quarter_logits = QuarterLogits(answers.Logits(prompt, mask));
        AddSettled(candidate);
        candidates_.push_back(std::move(candidate));
      }
    }
    return absl::OkStatus();
  }

  void AddSettled(const ProposedMask& candidate) {
    const bool small = static_cast<double>(candidate.mask.area()) <
                       request_.settled_area * static_cast<double>(settled_.size());
    if (!small || !request_.IsSure(candidate)) return;
    for (size_t cell = 0; cell < settled_.size(); ++cell) {
      settled_[cell] |= static_cast<uint8_t>(candidate.mask.Holds(cell));
    }
  }

  bool IsKept(const GridMask& mask) const {
    const auto& kept = proposals_.kept;
    return std::any_of(kept.begin(), kept.end(), [&](const ProposedMask& other) {
      return mask.IsDuplicate(other.mask, kDuplicateMaskIou);
    });
  }

  PromptedSegmenter& segmenter_;
  const ProposalRequest& request_;
  absl::FunctionRef<absl::Status()> progress_;
  std::vector<ProposedMask> candidates_;
  std::vector<uint8_t> settled_;  // [cells] 1: a small sure mask holds the cell
  Proposals proposals_;
};

}  // namespace

// Points are in pixels of the photograph, the first pixel's centre at 0.5; cells follow in reading
// order.
size_t ProposalRequest::CellOf(const PromptPoint& point) const {
  const auto cell = [&](float at, int count) {
    return std::clamp(static_cast<int>(at * grid.cells_per_pixel), 0, count - 1);
  };
  return static_cast<size_t>(cell(point.y, grid.height)) * grid.width + cell(point.x, grid.width);
}

bool ProposalRequest::HasGoodArea(int64_t area) const {
  // Shares of the grid, which covers the whole photograph.
  const double share = static_cast<double>(area) / (static_cast<double>(grid.width) * grid.height);
  return area > 0 && share >= kMinMaskArea && share <= kMaxMaskArea;
}

ProposedMask ReadMask(const PromptAnswers& answers, size_t prompt, size_t mask) {
  const std::span<const float> logits = answers.Logits(prompt, mask);
  ProposedMask read;
  read.mask = GridMask(logits, 0);
  read.iou = answers.Iou(prompt, mask);
  const GridMask wide(logits, -kStabilityOffset);
  if (wide.area() > 0) {
    read.stability = static_cast<float>(GridMask(logits, kStabilityOffset).area()) /
                     static_cast<float>(wide.area());
  }
  return read;
}

absl::StatusOr<Proposals> ProposeBySegmenting(PromptedSegmenter& segmenter,
                                              const ProposalRequest& request,
                                              absl::FunctionRef<absl::Status()> progress) {
  HostProposals proposals(segmenter, request, progress);
  RETURN_IF_ERROR(proposals.Ask(request.always, /*skip_settled=*/false));
  RETURN_IF_ERROR(proposals.Ask(request.unsettled, /*skip_settled=*/true));
  return std::move(proposals).Choose();
}

absl::StatusOr<std::vector<ProposedMask>> MatchBySegmenting(
    PromptedSegmenter& segmenter, std::span<const TargetedPrompt> prompts,
    absl::FunctionRef<absl::Status()> progress) {
  std::vector<ProposedMask> best(prompts.size());
  for (size_t first = 0; first < prompts.size(); first += kPromptsPerRun) {
    const auto batch = prompts.subspan(first, std::min(kPromptsPerRun, prompts.size() - first));
    std::vector<SegmenterPrompt> asked;
    for (const TargetedPrompt& prompt : batch) asked.push_back(prompt.prompt);
    RETURN_IF_ERROR(progress());
    ASSIGN_OR_RETURN(const PromptAnswers answers, segmenter.Segment(asked));
    for (size_t prompt = 0; prompt < batch.size(); ++prompt) {
      double best_iou = 0;
      for (size_t mask = 0; mask < PromptAnswers::kMasks; ++mask) {
        ProposedMask answer = ReadMask(answers, prompt, mask);
        const double iou = answer.mask.Iou(batch[prompt].target);
        if (iou <= best_iou) continue;
        best_iou = iou;
        answer.quarter_logits = QuarterLogits(answers.Logits(prompt, mask));
        best[first + prompt] = std::move(answer);
      }
    }
  }
  return best;
}

absl::StatusOr<Proposals> PromptedSegmenter::Propose(const ProposalRequest& request,
                                                     absl::FunctionRef<absl::Status()> progress) {
  return ProposeBySegmenting(*this, request, progress);
}

absl::StatusOr<std::vector<ProposedMask>> PromptedSegmenter::Match(
    std::span<const TargetedPrompt> prompts, absl::FunctionRef<absl::Status()> progress) {
  return MatchBySegmenting(*this, prompts, progress);
}

absl::StatusOr<std::vector<std::vector<PixelRun>>> PromptedSegmenter::Enlarge(
    std::span<const ProposedMask> masks, const View& view) {
  const PromptAnswers grid = AnswerGrid(view.photo.width, view.photo.height, extent());
  std::vector<std::vector<PixelRun>> runs;
  for (const ProposedMask& mask : masks) {
    runs.push_back(PixelsOfLogits(mask.quarter_logits, grid, view));
  }
  return runs;
}

}  // namespace pepeseg
