#include "core/prompt/ladder.h"

#include <algorithm>
#include <span>
#include <tuple>

namespace pepeseg {
namespace {

// Minimum IoU of a rung's mask with the most stable cell of its plateau. The best rung keeps its
// mask exactly, because that mask answers the click.
constexpr double kSameAsBest = 0.9999, kSameAsOther = 0.9;

// A cell that may represent a plateau on the ladder.
struct Candidate {
  MaskGrid::Cell cell;
  size_t plateau = 0;
  int64_t area = 0;
  double value = 0;  // support of the plateau times the IoU with its most stable cell
};

// The best sum of values of a partial ladder that ends at a candidate, and the index of the
// candidate next to it; -1: none.
struct Reach {
  double value = 0;
  int next = -1;
};

// Returns whether `large` may stand on a ladder above `small`.
bool Holds(const MaskGrid& masks, const Candidate& large, const Candidate& small) {
  return small.cell.scale <= large.cell.scale &&
         static_cast<double>(large.area) >= Ladder::kMinGrowth * static_cast<double>(small.area) &&
         static_cast<double>(masks.Common(small.cell, large.cell)) >=
             Ladder::kMinHeld * static_cast<double>(small.area);
}

// Returns all cells that may represent one of the plateaus, the smallest mask first.
std::vector<Candidate> FindCandidates(const MaskGrid& masks,
                                      std::span<const MaskGrid::Plateau> plateaus, size_t best) {
  const double one_cell = 1.0 / (masks.num_scales() * masks.num_thresholds());
  std::vector<Candidate> found;
  for (size_t p = 0; p < plateaus.size(); ++p) {
    if (p != best && plateaus[p].support < 1.5 * one_cell) continue;
    for (int scale = 0; scale < masks.num_scales(); ++scale) {
      for (int threshold = 0; threshold < masks.num_thresholds(); ++threshold) {
        const MaskGrid::Cell cell = {scale, threshold};
        const double iou = masks.Iou(plateaus[p].cell, cell);
        if (iou < (p == best ? kSameAsBest : kSameAsOther)) continue;
        found.push_back({cell, p, masks.Area(cell), plateaus[p].support * iou});
      }
    }
  }
  std::sort(found.begin(), found.end(), [](const Candidate& a, const Candidate& b) {
    return std::tie(a.area, a.cell.scale, a.cell.threshold, a.plateau) <
           std::tie(b.area, b.cell.scale, b.cell.threshold, b.plateau);
  });
  return found;
}

// Returns, for each candidate, the best partial ladder of smaller candidates (`down`) or of larger
// ones, by dynamic programming over the candidates in order of area.
std::vector<Reach> FindReaches(const MaskGrid& masks, std::span<const Candidate> candidates,
                               bool down) {
  const auto num = static_cast<int>(candidates.size());
  std::vector<Reach> reaches(candidates.size());
  for (int step = 0; step < num; ++step) {
    const int i = down ? step : num - 1 - step;
    for (int before = 0; before < step; ++before) {
      const int j = down ? before : num - 1 - before;
      if (reaches[j].value <= reaches[i].value) continue;
      const Candidate& large = candidates[down ? i : j];
      if (Holds(masks, large, candidates[down ? j : i])) reaches[i] = {reaches[j].value, j};
    }
    reaches[i].value += candidates[i].value;
  }
  return reaches;
}

// Removes the rungs with the least support, but not the best one.
void Shorten(size_t max_count, Ladder& ladder) {
  while (ladder.rungs.size() > max_count) {
    int least = -1;
    for (int i = 0; i < static_cast<int>(ladder.rungs.size()); ++i) {
      if (i == ladder.best) continue;
      if (least < 0 || ladder.rungs[i].support < ladder.rungs[least].support) least = i;
    }
    ladder.rungs.erase(ladder.rungs.begin() + least);
    if (least < ladder.best) --ladder.best;
  }
}

}  // namespace

Ladder FindLadder(const MaskGrid& masks, std::span<const MaskGrid::Plateau> plateaus, size_t best,
                  int max_count) {
  const std::vector<Candidate> candidates = FindCandidates(masks, plateaus, best);
  const std::vector<Reach> down = FindReaches(masks, candidates, true);
  const std::vector<Reach> up = FindReaches(masks, candidates, false);
  int through = -1;
  double best_value = 0;
  for (int i = 0; i < static_cast<int>(candidates.size()); ++i) {
    const double value = down[i].value + up[i].value - candidates[i].value;
    if (candidates[i].plateau == best && (through < 0 || value > best_value)) {
      through = i;
      best_value = value;
    }
  }
  Ladder ladder;
  if (through < 0) return ladder;
  const auto rung = [&](int i) {
    const Candidate& at = candidates[i];
    return MaskGrid::Plateau{at.cell, masks.Stability(at.cell), plateaus[at.plateau].support};
  };
  for (int i = through; i >= 0; i = down[i].next) ladder.rungs.push_back(rung(i));
  std::reverse(ladder.rungs.begin(), ladder.rungs.end());
  ladder.best = static_cast<int>(ladder.rungs.size()) - 1;
  for (int i = up[through].next; i >= 0; i = up[i].next) ladder.rungs.push_back(rung(i));
  Shorten(static_cast<size_t>(max_count), ladder);
  return ladder;
}

}  // namespace pepeseg
