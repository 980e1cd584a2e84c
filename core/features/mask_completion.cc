#include "core/features/mask_completion.h"

#include <algorithm>
#include <cstdint>
#include <utility>

#include "core/features/mask_candidates.h"
#include "core/features/mask_scales.h"
#include "kernels/thread_pool.h"

namespace pepeseg {
namespace {

constexpr size_t kMinPixels = 8;  // of an added mask, as MaskScales requires

// Returns the pixels under each mask of a view.
std::vector<std::vector<uint32_t>> PixelsOf(const MaskSet& masks) {
  std::vector<std::vector<uint32_t>> pixels(masks.num_masks);
  for (size_t pixel = 0; pixel < masks.pixel_cell.size(); ++pixel) {
    ForEachMaskIn(CellBits(masks, masks.pixel_cell[pixel]),
                  [&](int mask) { pixels[mask].push_back(static_cast<uint32_t>(pixel)); });
  }
  return pixels;
}

// A mask of a near view that votes on the pixels of an added mask.
struct Voter {
  int near;  // index in Reprojection::near
  const MaskSet* masks;
  int mask;

  // Returns whether the mask covers a pixel of the near view.
  bool HasUnderMask(int32_t pixel) const {
    const std::span<const uint64_t> bits = CellBits(*masks, masks->pixel_cell[pixel]);
    return (bits[mask / 64] >> (mask % 64) & 1) != 0;
  }
};

// Returns whether more than half of the voters that know a pixel have it under their mask.
// A pixel that no voter knows is out: 0 > 0 is false.
bool IsIn(std::span<const Voter> voters, const Reprojection::Sight& sight) {
  int num_known = 0, num_in = 0;
  for (const Voter& voter : voters) {
    const int32_t pixel = sight[voter.near];
    if (pixel == Reprojection::kUnknown) continue;
    ++num_known;
    num_in += voter.HasUnderMask(pixel) ? 1 : 0;
  }
  return 2 * num_in > num_known;
}

// Returns the pixels of the view that each group of voters has under its masks.
std::vector<std::vector<uint32_t>> Vote(const View& view, int number,
                                        const Reprojection& reprojection,
                                        std::span<const std::vector<Voter>> groups) {
  std::vector<std::vector<uint32_t>> pixels(groups.size());
  const auto num_pixels = static_cast<int32_t>(view.masks.pixel_cell.size());
  for (int32_t pixel = 0; pixel < num_pixels; ++pixel) {
    const Reprojection::Sight sight = reprojection.Look(number, pixel);
    for (size_t group = 0; group < groups.size(); ++group) {
      if (IsIn(groups[group], sight)) pixels[group].push_back(static_cast<uint32_t>(pixel));
    }
  }
  return pixels;
}

// Returns whether no mask is empty. MaskSetBuilder drops an empty mask, which would renumber the
// others.
bool AllHavePixels(const std::vector<std::vector<uint32_t>>& masks) {
  return std::ranges::none_of(masks, [](const auto& pixels) { return pixels.empty(); });
}

// The groups of near views that vote on masks to add.
struct Ballot {
  std::vector<std::vector<Voter>> groups;
  std::vector<float> scales;  // by group, scene units
};

Ballot MakeBallot(const Capture& capture, int number, const Reprojection& reprojection,
                  const MaskAgreements& agreements,
                  std::span<const std::vector<float>> mask_scales) {
  const std::span<const int> near = reprojection.near(number);
  const MaskCandidates candidates(capture, number, reprojection, agreements, mask_scales);
  Ballot ballot;
  for (const std::vector<int>& group : candidates.Groups()) {
    std::vector<Voter> voters;
    std::vector<float> scales;
    for (const int candidate : group) {
      const MaskCandidate& at = candidates.at(candidate);
      voters.push_back({at.near, &capture.views[near[at.near]].masks, at.mask});
      scales.push_back(mask_scales[near[at.near]][at.mask]);
    }
    ballot.groups.push_back(std::move(voters));
    // The voters' masks show the same surface, so their scales estimate that of the added mask,
    // which need not be measured in this view.
    ballot.scales.push_back(MedianScale(std::move(scales)));
  }
  return ballot;
}

// Completes the masks of one view.
CompletedMasks Complete(const Capture& capture, int number, const Reprojection& reprojection,
                        const MaskAgreements& agreements,
                        std::span<const std::vector<float>> mask_scales) {
  const View& view = capture.views[number];
  const Ballot ballot = MakeBallot(capture, number, reprojection, agreements, mask_scales);
  const std::vector<std::vector<uint32_t>> own = PixelsOf(view.masks);
  if (ballot.groups.empty() || !AllHavePixels(own)) return {};
  constexpr double kKeepDuplicates = 1;  // IoU above which masks are dropped: none is
  MaskSetBuilder builder(view.masks.width, view.masks.height, kKeepDuplicates);
  // Own masks come first and keep their numbers, to which agreements and scales refer.
  for (const std::vector<uint32_t>& pixels : own) builder.Add(pixels);
  const auto added = Vote(view, number, reprojection, ballot.groups);
  CompletedMasks completed;
  for (size_t group = 0; group < added.size(); ++group) {
    if (added[group].size() < kMinPixels) continue;
    if (builder.Add(added[group])) completed.added_scales.push_back(ballot.scales[group]);
  }
  if (!completed.added_scales.empty()) completed.masks = std::move(builder).Build();
  return completed;
}

}  // namespace

std::vector<CompletedMasks> CompleteMasks(const Capture& capture, const Reprojection& reprojection,
                                          const MaskAgreements& agreements,
                                          std::span<const std::vector<float>> mask_scales) {
  const std::span<const int> views = reprojection.views();
  std::vector<CompletedMasks> completed(capture.views.size());
  ThreadPool pool(0);
  pool.ParallelFor(static_cast<int64_t>(views.size()), [&](int64_t i, int) {
    completed[views[i]] = Complete(capture, views[i], reprojection, agreements, mask_scales);
  });
  return completed;
}

}  // namespace pepeseg
