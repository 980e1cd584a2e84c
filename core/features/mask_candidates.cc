#include "core/features/mask_candidates.h"

#include <algorithm>
#include <utility>

#include "core/features/mask_scales.h"

namespace pepeseg {
namespace {

constexpr int kMinCells = 12;        // grid cells under a mask that is added
constexpr size_t kMinGroup = 2;      // near views that hold the surface as one mask
constexpr double kMinShare = 0.5;    // these views as a share of all views that see the surface
constexpr double kMinSupport = 0.5;  // share of the views that see a candidate and agree with it

// Returns whether enough near views of the mask's own view have a mask of the same surface.
bool IsSupported(const MaskAgreement& agreement) {
  return agreement.num_same >= 1 && agreement.num_same >= kMinSupport * agreement.num_seen;
}

float Ratio(int shared, int all) {
  return all == 0 ? 0 : static_cast<float>(shared) / static_cast<float>(all);
}

}  // namespace

MaskCandidates::MaskCandidates(const Capture& capture, int view, const Reprojection& reprojection,
                               const MaskAgreements& agreements,
                               std::span<const std::vector<float>> mask_scales) {
  const std::span<const int> near = reprojection.near(view);
  num_near_ = near.size();
  List(capture, view, reprojection, agreements, mask_scales);
  const std::vector<Cell> cells = Cells(capture, view, reprojection);
  FindLacking(capture, view, near, cells);
  CountShared(capture, near, cells);
}

void MaskCandidates::List(const Capture& capture, int view, const Reprojection& reprojection,
                          const MaskAgreements& agreements,
                          std::span<const std::vector<float>> mask_scales) {
  const std::span<const int> near = reprojection.near(view);
  for (size_t i = 0; i < near.size(); ++i) {
    const int num_masks = capture.views[near[i]].masks.num_masks;
    std::vector<int>& numbers = number_of_.emplace_back(num_masks, -1);
    for (int mask = 0; mask < num_masks; ++mask) {
      if (mask_scales[near[i]][mask] <= kNoScale) continue;
      if (!IsSupported(agreements[near[i]][mask])) continue;
      numbers[mask] = static_cast<int>(candidates_.size());
      candidates_.push_back({.near = static_cast<int>(i), .mask = mask});
    }
  }
}

std::vector<MaskCandidates::Cell> MaskCandidates::Cells(const Capture& capture, int number,
                                                        const Reprojection& reprojection) {
  const View& view = capture.views[number];
  const int stride = reprojection.stride(number);
  std::vector<Cell> cells;
  for (int y = 0; y < view.masks.height; y += stride) {
    for (int x = 0; x < view.masks.width; x += stride) {
      const int32_t pixel = y * view.masks.width + x;
      if (!view.ignore.empty() && view.ignore[pixel] != 0) continue;
      cells.push_back({view.masks.pixel_cell[pixel], reprojection.Look(number, pixel)});
    }
  }
  return cells;
}

void MaskCandidates::ListAt(const Capture& capture, std::span<const int> near, const Cell& cell,
                            std::vector<int>& candidates) const {
  candidates.clear();
  for (size_t i = 0; i < near.size(); ++i) {
    if (cell.sight[i] == Reprojection::kUnknown) continue;
    const MaskSet& masks = capture.views[near[i]].masks;
    ForEachMaskIn(CellBits(masks, masks.pixel_cell[cell.sight[i]]), [&](int mask) {
      if (number_of_[i][mask] >= 0) candidates.push_back(number_of_[i][mask]);
    });
  }
}

// A candidate is lacking if no own mask has an IoU of kSameMask with it. The IoU counts the cells
// that the candidate's near view sees: elsewhere the candidate cannot be known.
void MaskCandidates::FindLacking(const Capture& capture, int view, std::span<const int> near,
                                 std::span<const Cell> cells) {
  const MaskSet& masks = capture.views[view].masks;
  const auto num_own = static_cast<size_t>(masks.num_masks);
  std::vector<int> shared(candidates_.size() * num_own);
  std::vector<int> own(near.size() * num_own);  // cells of own masks that each near view sees
  std::vector<int> here;
  for (const Cell& cell : cells) {
    ListAt(capture, near, cell, here);
    const std::span<const uint64_t> bits = CellBits(masks, cell.own_patch);
    for (size_t i = 0; i < near.size(); ++i) {
      if (cell.sight[i] == Reprojection::kUnknown) continue;
      ForEachMaskIn(bits, [&](int mask) { ++own[i * num_own + mask]; });
    }
    for (const int candidate : here) {
      MaskCandidate& at = candidates_[candidate];
      ++at.num_cells;
      for (size_t i = 0; i < near.size(); ++i) {
        at.known_cells[i] += cell.sight[i] == Reprojection::kUnknown ? 0 : 1;
      }
      ForEachMaskIn(bits, [&](int mask) { ++shared[candidate * num_own + mask]; });
    }
  }
  for (size_t c = 0; c < candidates_.size(); ++c) {
    MaskCandidate& candidate = candidates_[c];
    float best = 0;
    for (size_t mask = 0; mask < num_own; ++mask) {
      const int both = shared[c * num_own + mask];
      best = std::max(
          best, Ratio(both, candidate.num_cells + own[candidate.near * num_own + mask] - both));
    }
    candidate.lacking = candidate.num_cells >= kMinCells && best < kSameMask;
  }
}

void MaskCandidates::CountShared(const Capture& capture, std::span<const int> near,
                                 std::span<const Cell> cells) {
  // Counts [candidate, other] pairs, for lacking candidates only: no other row is read.
  const size_t count = candidates_.size();
  shared_.assign(count * count, 0);
  if (std::ranges::none_of(candidates_, &MaskCandidate::lacking)) return;
  std::vector<int> here;
  for (const Cell& cell : cells) {
    ListAt(capture, near, cell, here);
    for (const int candidate : here) {
      if (!candidates_[candidate].lacking) continue;
      int* shared = shared_.data() + static_cast<size_t>(candidate) * count;
      for (const int other : here) ++shared[other];
    }
  }
}

// Computes the IoU over the cells that both near views see.
float MaskCandidates::Iou(int lacking, int other) const {
  const MaskCandidate &a = candidates_[lacking], &b = candidates_[other];
  const int shared = shared_[static_cast<size_t>(lacking) * candidates_.size() + other];
  return Ratio(shared, a.known_cells[b.near] + b.known_cells[a.near] - shared);
}

double MaskCandidates::Support(int lacking) const {
  double support = 0;
  for (size_t other = 0; other < candidates_.size(); ++other) {
    if (candidates_[other].near == candidates_[lacking].near) continue;
    const float iou = Iou(lacking, static_cast<int>(other));
    if (iou >= kSameMask) support += double{iou};
  }
  return support;
}

// Takes from each other near view the candidate that is most like the seed, if any is of its
// surface. A near view sees the surface if it sees half of the seed's cells.
std::vector<int> MaskCandidates::GroupOf(int seed) const {
  const MaskCandidate& of_seed = candidates_[seed];
  std::vector<int> best(num_near_, -1);
  // Starting at kSameMask makes a view without a mask of this surface have no best.
  std::vector<float> best_iou(num_near_, kSameMask);
  for (size_t other = 0; other < candidates_.size(); ++other) {
    const int near = candidates_[other].near;
    if (near == of_seed.near) continue;
    const float iou = Iou(seed, static_cast<int>(other));
    if (iou < best_iou[near]) continue;
    best[near] = static_cast<int>(other);
    best_iou[near] = iou;
  }
  std::vector<int> group = {seed};
  // This view sees the surface and lacks the mask, so it counts against the group.
  int num_seeing = 2;  // the seed's view and this view
  for (size_t i = 0; i < num_near_; ++i) {
    if (static_cast<int>(i) == of_seed.near) continue;
    if (2 * of_seed.known_cells[i] < of_seed.num_cells) continue;
    ++num_seeing;
    if (best[i] >= 0) group.push_back(best[i]);
  }
  const bool enough =
      group.size() >= kMinGroup && static_cast<double>(group.size()) >= kMinShare * num_seeing;
  return enough ? group : std::vector<int>();
}

// Greedy: the best supported candidate forms a group, and all candidates of its surface are used
// up.
std::vector<std::vector<int>> MaskCandidates::Groups() const {
  std::vector<std::pair<double, int>> order;
  for (size_t c = 0; c < candidates_.size(); ++c) {
    const auto candidate = static_cast<int>(c);
    // Negated: the largest support first, ties by number, so that the result is the same in each
    // run.
    if (candidates_[c].lacking) order.emplace_back(-Support(candidate), candidate);
  }
  std::ranges::sort(order);
  std::vector<std::vector<int>> groups;
  std::vector<bool> used(candidates_.size());
  for (const auto& [support, seed] : order) {
    if (used[seed]) continue;
    std::vector<int> group = GroupOf(seed);
    if (group.empty()) continue;
    for (size_t other = 0; other < candidates_.size(); ++other) {
      if (Iou(seed, static_cast<int>(other)) >= kSameMask) used[other] = true;
    }
    groups.push_back(std::move(group));
  }
  return groups;
}

}  // namespace pepeseg
