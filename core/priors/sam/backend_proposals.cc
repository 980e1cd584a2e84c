#include "core/priors/sam/backend_proposals.h"

#include <algorithm>
#include <numeric>
#include <utility>

#include "core/base/status_macros.h"
#include "core/priors/sam/decoder_layers.h"

namespace pepeseg {
namespace {

// A candidate of ProposeOnBackend, without its cells.
struct Scored {
  int32_t mask = 0;  // index among the decoded masks
  int32_t area = 0;
  int32_t cell = 0;  // bit of the prompt's point in the mask, on the decoder's square
  ProposedMask scores;
};

// Scores of decoded masks, on the host.
struct Scores {
  explicit Scores(const DecodedMasks& masks)
      : ious(static_cast<size_t>(masks.ious.size())), areas(masks.areas.size()) {
    masks.ious.Download(ious);
    masks.areas.Download(areas);
  }
  int32_t Area(size_t mask) const { return areas[mask * 3 + 1]; }
  // Returns a mask's scores, without its cells.
  ProposedMask Of(size_t mask) const {
    ProposedMask scores;
    scores.iou = ious[mask];
    const int32_t wide = areas[mask * 3], narrow = areas[mask * 3 + 2];  // over -1 and over 1
    if (wide > 0) scores.stability = static_cast<float>(narrow) / static_cast<float>(wide);
    return scores;
  }

  std::vector<float> ious;     // [masks]
  std::vector<int32_t> areas;  // [masks, 3], over -1, 0 and 1
};

// Returns the candidates in the order in which ProposeBySegmenting examines them: the sure ones,
// then the fillers, each by IoU.
std::vector<Scored> Candidates(const ProposalRequest& request, const DecodedMasks& masks,
                               const std::vector<PromptPoint>& points, int extent) {
  const Scores all(masks);
  std::vector<Scored> candidates;
  for (size_t prompt = 0; prompt < points.size(); ++prompt) {
    const size_t cell = request.CellOf(points[prompt]);
    const size_t y = cell / request.grid.width, x = cell % request.grid.width;
    // Mask 0 is for prompts of several points.
    for (size_t k = 1; k < PromptAnswers::kMasks; ++k) {
      const size_t mask = prompt * PromptAnswers::kMasks + k;
      Scored scored = {static_cast<int32_t>(mask), all.Area(mask),
                       static_cast<int32_t>(y * extent + x), all.Of(mask)};
      scored.scores.cell = cell;
      if (scored.scores.iou < request.min_filler_iou ||
          scored.scores.stability < request.min_filler_stability ||
          !request.HasGoodArea(scored.area)) {
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

// Copies the logits of decoded masks with these indices to the host in one piece, and sets those of
// `masks`: the cells of the grid.
void DownloadLogits(Backend& backend, const DecodedMasks& decoded, std::span<const int32_t> indices,
                    int extent, const PromptAnswers& grid, std::span<ProposedMask* const> masks) {
  const int64_t cells = int64_t{extent} * extent;
  Buffer<int8_t> chosen(backend, static_cast<int64_t>(indices.size()) * cells);
  if (chosen.empty()) return;
  for (size_t i = 0; i < indices.size(); ++i) {
    backend.Copy(chosen.span().data + static_cast<int64_t>(i) * cells,
                 decoded.quarters.span().data + indices[i] * cells, static_cast<size_t>(cells));
  }
  std::vector<int8_t> squares(static_cast<size_t>(chosen.size()));
  chosen.Download(squares);
  for (size_t i = 0; i < indices.size(); ++i) {
    std::vector<int8_t>& logits = masks[i]->quarter_logits;
    logits.reserve(static_cast<size_t>(grid.width) * grid.height);
    for (int y = 0; y < grid.height; ++y) {
      const auto row = squares.begin() + static_cast<ptrdiff_t>(i * cells + int64_t{y} * extent);
      logits.insert(logits.end(), row, row + grid.width);
    }
  }
}

// Drops duplicates on the backend and returns the kept candidates in order, without logits.
// `indices` gets their indices among the decoded masks.
absl::StatusOr<std::vector<ProposedMask>> Suppress(Backend& backend, const ProposalRequest& request,
                                                   const DecodedMasks& masks, int extent,
                                                   std::vector<Scored> candidates,
                                                   std::vector<int32_t>& indices) {
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
  RETURN_IF_ERROR(ErrorOf(backend));
  backend.SuppressMasks({words, masks.bits.span(), order_buffer.span(), area_buffer.span(),
                         cell_buffer.span(), kDuplicateMaskIou, kept.span(), kept_bits.span()});
  std::vector<uint8_t> flags(order.size());
  kept.Download(flags);
  std::vector<uint32_t> bits(std::accumulate(flags.begin(), flags.end(), size_t{0}) * words);
  kept_bits.Download(bits);
  std::vector<ProposedMask> left;
  for (size_t i = 0; i < candidates.size(); ++i) {
    if (flags[i] == 0) continue;
    ProposedMask mask = std::move(candidates[i].scores);
    mask.mask = GridMask(std::span<const uint32_t>(bits).subspan(left.size() * words, words),
                         extent, request.grid.width, request.grid.height);
    left.push_back(std::move(mask));
    indices.push_back(candidates[i].mask);
  }
  return left;
}

std::vector<ProposedMask*> PointersTo(std::vector<ProposedMask>& masks) {
  std::vector<ProposedMask*> pointers;
  for (ProposedMask& mask : masks) pointers.push_back(&mask);
  return pointers;
}

}  // namespace

namespace {

// Returns a point in pixels of the frame, whose first pixel has its centre at 0.
DecoderPoint InFrame(const PromptPoint& point, int32_t label, const PromptAnswers& grid,
                     const DecoderNetwork& decoder) {
  const double scale = grid.cells_per_pixel * decoder.frame() / decoder.extent();
  return {static_cast<float>(point.x * scale - 0.5), static_cast<float>(point.y * scale - 0.5),
          label};
}

}  // namespace

void AppendPrompt(const SegmenterPrompt& prompt, const PromptAnswers& grid,
                  const DecoderNetwork& decoder, std::vector<DecoderPoint>& points) {
  for (const PromptPoint& point : prompt) {
    points.push_back(InFrame(point, point.positive ? 1 : 0, grid, decoder));
  }
  points.push_back({0, 0, -1});
}

void AppendPrompt(const MaskPrompt& prompt, const PromptAnswers& grid,
                  const DecoderNetwork& decoder, std::vector<DecoderPoint>& points) {
  AppendPrompt(prompt.points, grid, decoder, points);
  if (!prompt.box) return;
  points.back() = InFrame((*prompt.box)[0], 2, grid, decoder);  // in place of the padding
  points.push_back(InFrame((*prompt.box)[1], 3, grid, decoder));
}

absl::StatusOr<Proposals> ProposeOnBackend(Backend& backend, DecoderNetwork& decoder,
                                           ConstNetworkSpan embedding,
                                           const ProposalRequest& request) {
  std::vector<PromptPoint> points = request.always;
  points.insert(points.end(), request.unsettled.begin(), request.unsettled.end());
  Proposals proposals;
  proposals.num_prompts = static_cast<int>(points.size());
  if (points.empty()) return proposals;
  std::vector<DecoderPoint> prompts;
  for (const PromptPoint& point : points) AppendPrompt({point}, request.grid, decoder, prompts);
  const int extent = decoder.extent();
  DecodedMasks masks;
  RETURN_IF_ERROR(decoder.Decode(embedding, prompts, 2, {request.grid.width, request.grid.height},
                                 false, masks));
  std::vector<Scored> candidates = Candidates(request, masks, points, extent);
  RETURN_IF_ERROR(ErrorOf(backend));
  if (candidates.empty()) return proposals;
  std::vector<int32_t> indices;
  ASSIGN_OR_RETURN(proposals.kept,
                   Suppress(backend, request, masks, extent, std::move(candidates), indices));
  DownloadLogits(backend, masks, indices, extent, request.grid, PointersTo(proposals.kept));
  RETURN_IF_ERROR(ErrorOf(backend));
  return proposals;
}

absl::StatusOr<std::vector<ProposedMask>> MatchOnBackend(Backend& backend, DecoderNetwork& decoder,
                                                         ConstNetworkSpan embedding,
                                                         const PromptAnswers& grid,
                                                         std::span<const TargetedPrompt> prompts) {
  std::vector<ProposedMask> best(prompts.size());
  if (prompts.empty()) return best;
  std::vector<DecoderPoint> points;
  for (const TargetedPrompt& prompt : prompts) AppendPrompt(prompt.prompt, grid, decoder, points);
  DecodedMasks masks;
  RETURN_IF_ERROR(decoder.Decode(embedding, points,
                                 static_cast<int>(points.size() / prompts.size()),
                                 {grid.width, grid.height}, false, masks));
  const Scores scores(masks);
  const int extent = decoder.extent();
  const size_t words = static_cast<size_t>(extent) * extent / 32;
  std::vector<uint32_t> bits(static_cast<size_t>(masks.bits.size()));
  masks.bits.Download(bits);
  RETURN_IF_ERROR(ErrorOf(backend));
  std::vector<int32_t> indices;
  std::vector<ProposedMask*> found;
  for (size_t prompt = 0; prompt < prompts.size(); ++prompt) {
    double best_iou = 0;
    size_t best_mask = 0;
    for (size_t k = 0; k < PromptAnswers::kMasks; ++k) {
      const size_t mask = prompt * PromptAnswers::kMasks + k;
      GridMask cells(std::span<const uint32_t>(bits).subspan(mask * words, words), extent,
                     grid.width, grid.height);
      const double iou = cells.Iou(prompts[prompt].target);
      if (iou <= best_iou) continue;
      best_iou = iou;
      best_mask = mask;
      best[prompt] = scores.Of(mask);
      best[prompt].mask = std::move(cells);
    }
    if (best_iou == 0) continue;
    indices.push_back(static_cast<int32_t>(best_mask));
    found.push_back(&best[prompt]);
  }
  DownloadLogits(backend, masks, indices, extent, grid, found);
  RETURN_IF_ERROR(ErrorOf(backend));
  return best;
}

absl::StatusOr<std::vector<std::vector<PixelRun>>> EnlargeOnBackend(
    Backend& backend, int extent, std::span<const ProposedMask> masks, const View& view) {
  std::vector<std::vector<PixelRun>> pixels(masks.size());
  if (masks.empty()) return pixels;
  const int width = view.photo.width, height = view.photo.height;
  const PromptAnswers grid = AnswerGrid(width, height, extent);
  const size_t cells = static_cast<size_t>(extent) * extent;
  std::vector<int8_t> squares(masks.size() * cells);
  std::vector<int32_t> numbers(masks.size());
  std::iota(numbers.begin(), numbers.end(), 0);
  for (size_t i = 0; i < masks.size(); ++i) {
    for (int y = 0; y < grid.height; ++y) {
      const auto row = masks[i].quarter_logits.begin() + static_cast<ptrdiff_t>(y) * grid.width;
      std::copy(row, row + grid.width,
                squares.begin() + static_cast<ptrdiff_t>(i * cells + size_t(y) * extent));
    }
  }
  const Buffer<int8_t> quarters(backend, std::span<const int8_t>(squares));
  const Buffer<int32_t> order(backend, std::span<const int32_t>(numbers));
  const Buffer<uint8_t> ignored(backend, std::span<const uint8_t>(view.ignore));
  Buffer<int32_t> first_run, runs;
  RETURN_IF_ERROR(ErrorOf(backend));
  backend.EnlargeMasks({extent, grid.width, grid.height, grid.cells_per_pixel, width, height,
                        quarters.span(), order.span(), ignored.span(), &first_run, &runs});
  std::vector<int32_t> first(static_cast<size_t>(first_run.size())), ends(runs.size());
  first_run.Download(first);
  runs.Download(ends);
  RETURN_IF_ERROR(ErrorOf(backend));
  for (size_t i = 0; i < masks.size(); ++i) {
    const size_t scanline = i * height;
    pixels[i].reserve(static_cast<size_t>(first[scanline + height] - first[scanline]));
    for (int y = 0; y < height; ++y) {
      const auto row = static_cast<uint32_t>(y) * static_cast<uint32_t>(width);
      for (int32_t run = first[scanline + y]; run < first[scanline + y + 1]; ++run) {
        pixels[i].push_back({row + static_cast<uint32_t>(ends[2 * run]),
                             row + static_cast<uint32_t>(ends[2 * run + 1])});
      }
    }
  }
  return pixels;
}

}  // namespace pepeseg
