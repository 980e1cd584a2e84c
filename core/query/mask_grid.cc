#include "core/query/mask_grid.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <iterator>
#include <numeric>
#include <span>
#include <tuple>
#include <utility>

namespace pepeseg {
namespace {

constexpr int kNumScales = 21;
constexpr double kSmallestScale = 0.01;
constexpr float kThresholds[] = {0.5f, 0.55f, 0.6f, 0.65f, 0.7f, 0.75f, 0.8f, 0.85f, 0.9f, 0.95f};

// Turns [side, side] counts into cumulative ones: how many are at or over both indices.
void SumFromTop(int32_t* counts, int side) {
  for (int i = side - 1; i >= 0; --i) {
    for (int j = side - 1; j >= 0; --j) {
      int32_t& at = counts[i * side + j];
      if (i + 1 < side) at += counts[(i + 1) * side + j];
      if (j + 1 < side) at += counts[i * side + j + 1];
      if (i + 1 < side && j + 1 < side) at -= counts[(i + 1) * side + j + 1];
    }
  }
}

// Minimum IoU of a candidate's mask with the most stable cell of its plateau. The best one keeps
// its mask exactly, because that mask answers the click.
constexpr double kSameAsBest = 0.9999, kSameAsOther = 0.9;

// A cell that may represent a plateau among the candidates.
struct Rung {
  GridCell cell;
  size_t plateau = 0;
  int64_t area = 0;
  double value = 0;  // support of the plateau times the IoU with its most stable cell
};

// The best sum of values of a partial list that ends at a rung, and the index of the rung next to
// it; -1: none.
struct Reach {
  double value = 0;
  int next = -1;
};

// Returns whether `large` may come after `small`.
bool Holds(const MaskGrid& masks, const Rung& large, const Rung& small) {
  return small.cell.scale <= large.cell.scale &&
         static_cast<double>(large.area) >=
             Candidates::kMinGrowth * static_cast<double>(small.area) &&
         static_cast<double>(masks.Common(small.cell, large.cell)) >=
             Candidates::kMinHeld * static_cast<double>(small.area);
}

// Returns all cells that may represent one of the plateaus, the smallest mask first.
std::vector<Rung> FindRungs(const MaskGrid& masks, std::span<const Candidate> plateaus,
                            size_t best) {
  const double one_cell = 1.0 / (masks.num_scales() * masks.num_thresholds());
  std::vector<Rung> found;
  for (size_t p = 0; p < plateaus.size(); ++p) {
    if (p != best && plateaus[p].support < 1.5 * one_cell) continue;
    for (int scale = 0; scale < masks.num_scales(); ++scale) {
      for (int threshold = 0; threshold < masks.num_thresholds(); ++threshold) {
        const GridCell cell = {scale, threshold};
        const double iou = masks.Iou(plateaus[p].cell, cell);
        if (iou < (p == best ? kSameAsBest : kSameAsOther)) continue;
        found.push_back({cell, p, masks.Area(cell), plateaus[p].support * iou});
      }
    }
  }
  std::sort(found.begin(), found.end(), [](const Rung& a, const Rung& b) {
    return std::tie(a.area, a.cell.scale, a.cell.threshold, a.plateau) <
           std::tie(b.area, b.cell.scale, b.cell.threshold, b.plateau);
  });
  return found;
}

// Returns, for each rung, the best partial list of smaller rungs (`down`) or of larger ones, by
// dynamic programming over the rungs in order of area.
std::vector<Reach> FindReaches(const MaskGrid& masks, std::span<const Rung> rungs, bool down) {
  const auto num = static_cast<int>(rungs.size());
  std::vector<Reach> reaches(rungs.size());
  for (int step = 0; step < num; ++step) {
    const int i = down ? step : num - 1 - step;
    for (int before = 0; before < step; ++before) {
      const int j = down ? before : num - 1 - before;
      if (reaches[j].value <= reaches[i].value) continue;
      const Rung& large = rungs[down ? i : j];
      if (Holds(masks, large, rungs[down ? j : i])) reaches[i] = {reaches[j].value, j};
    }
    reaches[i].value += rungs[i].value;
  }
  return reaches;
}

// Removes the candidates with the least support, but not the best one.
void Shorten(size_t max_count, Candidates& candidates) {
  std::vector<Candidate>& list = candidates.list;
  while (list.size() > max_count) {
    int least = -1;
    for (int i = 0; i < static_cast<int>(list.size()); ++i) {
      if (i == candidates.best) continue;
      if (least < 0 || list[i].support < list[least].support) least = i;
    }
    list.erase(list.begin() + least);
    if (least < candidates.best) --candidates.best;
  }
}

}  // namespace

std::vector<size_t> Candidates::BySupport() const {
  std::vector<size_t> order(list.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [this](size_t a, size_t b) { return list[a].support > list[b].support; });
  return order;
}

GranularityGrid GridOf(const Granularity& granularity) {
  GranularityGrid grid;
  if (granularity.scale) {
    grid.scales = {*granularity.scale};
  } else {
    for (int i = 0; i < kNumScales; ++i) {
      grid.scales.push_back(std::max(kSmallestScale, static_cast<double>(i) / (kNumScales - 1)));
    }
  }
  if (granularity.threshold) {
    grid.thresholds = {static_cast<float>(*granularity.threshold)};
  } else {
    grid.thresholds.assign(std::begin(kThresholds), std::end(kThresholds));
  }
  return grid;
}

std::vector<uint8_t> LevelsOf(std::span<const float> similarity,
                              std::span<const float> thresholds) {
  std::vector<uint8_t> levels(similarity.size());
  for (const float threshold : thresholds) {  // one pass each, which the compiler vectorises
    for (size_t i = 0; i < levels.size(); ++i) levels[i] += similarity[i] > threshold ? 1 : 0;
  }
  return levels;
}

SmallView SmallViewOf(const ModelView& view) {
  SmallView small = {view, 1};
  Camera& camera = small.view.camera;
  const double num_pixels = static_cast<double>(camera.width) * camera.height;
  small.factor = std::max(
      1, static_cast<int>(std::ceil(std::sqrt(num_pixels / static_cast<double>(kMaxLookPixels)))));
  camera.width = std::max(1, camera.width / small.factor);
  camera.height = std::max(1, camera.height / small.factor);
  for (double* value : {&camera.fx, &camera.fy, &camera.cx, &camera.cy}) *value /= small.factor;
  return small;
}

MaskGrid::MaskGrid(LevelCounts counts, GranularityGrid grid)
    : grid_(std::move(grid)), counts_(std::move(counts)) {
  const size_t side = counts_.num_thresholds + 1;
  assert(counts_.pixels.size() ==
         side * side * static_cast<size_t>(counts_.num_scales) * counts_.num_scales);
  for (size_t pair = 0; pair < counts_.pixels.size(); pair += side * side) {
    SumFromTop(&counts_.pixels[pair], static_cast<int>(side));
  }
  stability_ = Stabilities();
}

size_t MaskGrid::IndexOf(const GridCell& cell) const {
  return static_cast<size_t>(cell.scale) * counts_.num_thresholds + cell.threshold;
}

GridCell MaskGrid::CellAt(size_t index) const {
  return {static_cast<int>(index) / counts_.num_thresholds,
          static_cast<int>(index) % counts_.num_thresholds};
}

int64_t MaskGrid::Area(const GridCell& cell) const { return Common(cell, cell); }

double MaskGrid::Stability(const GridCell& cell) const { return stability_[IndexOf(cell)]; }

Candidate MaskGrid::CandidateAt(const GridCell& cell, double support) const {
  return {grid_.scales[cell.scale], double{grid_.thresholds[cell.threshold]}, Stability(cell),
          support, cell};
}

int64_t MaskGrid::Common(const GridCell& a, const GridCell& b) const {
  if (a.scale > b.scale) return Common(b, a);
  const size_t side = counts_.num_thresholds + 1;
  const size_t pair = static_cast<size_t>(a.scale) * counts_.num_scales + b.scale;
  return counts_.pixels[(pair * side + a.threshold + 1) * side + b.threshold + 1];
}

double MaskGrid::Iou(const GridCell& a, const GridCell& b) const {
  const int64_t common = Common(a, b), either = Area(a) + Area(b) - common;
  return either == 0 ? 0 : static_cast<double>(common) / static_cast<double>(either);
}

std::vector<double> MaskGrid::Stabilities() const {
  const int num = counts_.num_thresholds;
  std::vector<double> sum(static_cast<size_t>(counts_.num_scales) * num);
  std::vector<int> count(sum.size());
  const auto add = [&](const GridCell& a, const GridCell& b) {
    const double iou = Iou(a, b);
    for (const GridCell& cell : {a, b}) {
      sum[cell.scale * num + cell.threshold] += iou;
      ++count[cell.scale * num + cell.threshold];
    }
  };
  for (int i = 0; i < counts_.num_scales; ++i) {
    for (int j = 0; j + 1 < num; ++j) add({i, j}, {i, j + 1});
    if (i + 1 == counts_.num_scales) break;
    for (int j = 0; j < num; ++j) add({i, j}, {i + 1, j});
  }
  for (size_t k = 0; k < sum.size(); ++k) sum[k] /= std::max(1, count[k]);
  return sum;
}

std::vector<Candidate> MaskGrid::FindPlateaus(int64_t min_area, int max_count) const {
  std::vector<size_t> left;  // cells, the most stable first
  for (size_t k = 0; k < stability_.size(); ++k) {
    if (Area(CellAt(k)) >= min_area) left.push_back(k);
  }
  std::stable_sort(left.begin(), left.end(),
                   [&](size_t a, size_t b) { return stability_[a] > stability_[b]; });
  std::vector<Candidate> plateaus;
  while (!left.empty()) {
    const GridCell best = CellAt(left.front());
    const auto before = static_cast<double>(left.size());
    std::erase_if(left, [&](size_t k) { return Iou(best, CellAt(k)) > kSameMask; });
    const double support =
        (before - static_cast<double>(left.size())) / static_cast<double>(stability_.size());
    plateaus.push_back(CandidateAt(best, support));
  }
  std::stable_sort(plateaus.begin(), plateaus.end(),
                   [](const Candidate& a, const Candidate& b) { return a.support > b.support; });
  if (plateaus.size() > static_cast<size_t>(max_count)) plateaus.resize(max_count);
  return plateaus;
}

Candidates FindCandidates(const MaskGrid& masks, std::span<const Candidate> plateaus, size_t best,
                          int max_count) {
  const std::vector<Rung> rungs = FindRungs(masks, plateaus, best);
  const std::vector<Reach> down = FindReaches(masks, rungs, true);
  const std::vector<Reach> up = FindReaches(masks, rungs, false);
  int through = -1;
  double best_value = 0;
  for (int i = 0; i < static_cast<int>(rungs.size()); ++i) {
    const double value = down[i].value + up[i].value - rungs[i].value;
    if (rungs[i].plateau == best && (through < 0 || value > best_value)) {
      through = i;
      best_value = value;
    }
  }
  Candidates candidates;
  if (through < 0) return candidates;
  const auto add = [&](int i) {
    candidates.list.push_back(masks.CandidateAt(rungs[i].cell, plateaus[rungs[i].plateau].support));
  };
  for (int i = through; i >= 0; i = down[i].next) add(i);
  std::reverse(candidates.list.begin(), candidates.list.end());
  candidates.best = static_cast<int>(candidates.list.size()) - 1;
  for (int i = up[through].next; i >= 0; i = up[i].next) add(i);
  Shorten(static_cast<size_t>(max_count), candidates);
  return candidates;
}

}  // namespace pepeseg
