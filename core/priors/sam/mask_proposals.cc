#include "core/priors/sam/mask_proposals.h"

#include <algorithm>
#include <numeric>
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
        Settle(candidate);
        candidates_.push_back(std::move(candidate));
      }
    }
    return absl::OkStatus();
  }

  void Settle(const ProposedMask& candidate) {
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
      return mask.Iou(other.mask) > kDuplicateMaskIou;
    });
  }

  PromptedSegmenter& segmenter_;
  const ProposalRequest& request_;
  absl::FunctionRef<absl::Status()> progress_;
  std::vector<ProposedMask> candidates_;
  std::vector<uint8_t> settled_;  // [cells] 1: a small sure mask holds the cell
  Proposals proposals_;
};

// A candidate of ProposeOnBackend, without its cells.
struct Scored {
  int32_t mask = 0;  // index among the decoded masks
  int32_t area = 0;
  int32_t cell = 0;  // bit of the prompt's point in the mask, on the decoder's square
  ProposedMask scores;
};

// Returns the candidates in the order in which ProposeBySegmenting examines them: the sure ones,
// then the fillers, each by IoU.
std::vector<Scored> Candidates(const ProposalRequest& request, const DecodedMasks& masks,
                               const std::vector<PromptPoint>& points, int extent) {
  std::vector<float> ious(static_cast<size_t>(masks.ious.size()));
  masks.ious.Download(ious);
  std::vector<int32_t> areas(static_cast<size_t>(masks.areas.size()));
  masks.areas.Download(areas);
  std::vector<Scored> candidates;
  for (size_t prompt = 0; prompt < points.size(); ++prompt) {
    const size_t cell = request.CellOf(points[prompt]);
    const size_t y = cell / request.grid.width, x = cell % request.grid.width;
    for (size_t k = kFirstMask; k < PromptAnswers::kMasks; ++k) {
      const size_t mask = prompt * PromptAnswers::kMasks + k;
      const int32_t* area = &areas[mask * 3];  // over -1, 0 and 1
      Scored scored = {
          static_cast<int32_t>(mask), area[1], static_cast<int32_t>(y * extent + x), {}};
      scored.scores.iou = ious[mask];
      scored.scores.cell = cell;
      if (area[0] > 0) {
        scored.scores.stability = static_cast<float>(area[2]) / static_cast<float>(area[0]);
      }
      if (scored.scores.iou < request.min_filler_iou ||
          scored.scores.stability < request.min_filler_stability || !request.HasGoodArea(area[1])) {
        continue;
      }
      candidates.push_back(std::move(scored));
    }
  }
  std::stable_sort(candidates.begin(), candidates.end(),
                   [](const Scored& a, const Scored& b) { return a.scores.iou > b.scores.iou; });
  std::stable_partition(candidates.begin(), candidates.end(),
                        [&](const Scored& scored) { return request.IsSure(scored.scores); });
  return candidates;
}

// Copies the cells of the grid from a square of `extent` cells a side.
std::vector<int8_t> Cropped(std::span<const int8_t> square, const PromptAnswers& grid, int extent) {
  std::vector<int8_t> cells;
  for (int y = 0; y < grid.height; ++y) {
    const auto row = square.subspan(static_cast<size_t>(y) * extent, grid.width);
    cells.insert(cells.end(), row.begin(), row.end());
  }
  return cells;
}

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

absl::StatusOr<Proposals> PromptedSegmenter::Propose(const ProposalRequest& request,
                                                     absl::FunctionRef<absl::Status()> progress) {
  return ProposeBySegmenting(*this, request, progress);
}

absl::StatusOr<Proposals> ProposeOnBackend(Backend& backend, DecoderNetwork& decoder,
                                           ConstNetworkSpan embedding,
                                           const ProposalRequest& request) {
  std::vector<PromptPoint> points = request.always;
  points.insert(points.end(), request.unsettled.begin(), request.unsettled.end());
  Proposals proposals;
  proposals.num_prompts = static_cast<int>(points.size());
  if (points.empty()) return proposals;
  const int extent = decoder.extent();
  const double scale = request.grid.cells_per_pixel * decoder.frame() / extent;
  std::vector<DecoderPoint> prompts;
  for (const PromptPoint& point : points) {
    prompts.push_back({static_cast<float>(point.x * scale - 0.5),
                       static_cast<float>(point.y * scale - 0.5), point.positive ? 1 : 0});
    prompts.push_back({0, 0, -1});
  }
  DecodedMasks masks;
  RETURN_IF_ERROR(decoder.Decode(embedding, prompts, 2, {request.grid.width, request.grid.height},
                                 false, masks));
  std::vector<Scored> candidates = Candidates(request, masks, points, extent);
  if (candidates.empty()) return proposals;
  std::vector<int32_t> order, areas, filler_cells;
  for (const Scored& candidate : candidates) {
    order.push_back(candidate.mask);
    areas.push_back(candidate.area);
    filler_cells.push_back(request.IsSure(candidate.scores) ? -1 : candidate.cell);
  }
  const Buffer<int32_t> order_buffer(backend, std::span<const int32_t>(order));
  const Buffer<int32_t> area_buffer(backend, std::span<const int32_t>(areas));
  const Buffer<int32_t> cell_buffer(backend, std::span<const int32_t>(filler_cells));
  const int words = extent * extent / 32;
  Buffer<uint8_t> kept(backend, static_cast<int64_t>(order.size()));
  Buffer<uint32_t> kept_bits(backend, static_cast<int64_t>(order.size()) * words);
  if (!backend.error().empty()) return absl::ResourceExhaustedError("SAM: " + backend.error());
  backend.SuppressMasks({words, masks.bits.span(), order_buffer.span(), area_buffer.span(),
                         cell_buffer.span(), kDuplicateMaskIou, kept.span(), kept_bits.span()});
  std::vector<uint8_t> flags(order.size());
  kept.Download(flags);
  std::vector<uint32_t> bits(std::accumulate(flags.begin(), flags.end(), size_t{0}) * words);
  kept_bits.Download(bits);
  std::vector<int8_t> square(static_cast<size_t>(extent) * extent);
  for (size_t i = 0; i < candidates.size(); ++i) {
    if (flags[i] == 0) continue;
    ProposedMask mask = std::move(candidates[i].scores);
    const size_t first = proposals.kept.size() * words;
    mask.mask = GridMask(std::span<const uint32_t>(bits).subspan(first, words), extent,
                         request.grid.width, request.grid.height);
    masks.quarters.Download(square, static_cast<int64_t>(candidates[i].mask) * extent * extent);
    mask.quarter_logits = Cropped(square, request.grid, extent);
    proposals.kept.push_back(std::move(mask));
  }
  if (!backend.error().empty()) return absl::InternalError("SAM: " + backend.error());
  return proposals;
}

}  // namespace pepeseg
