#include "core/query/mask_grid.h"

#include <algorithm>
#include <cassert>
#include <limits>
#include <numeric>
#include <utility>

namespace pepeseg {

std::vector<uint8_t> LevelsOf(std::span<const float> similarity,
                              std::span<const float> thresholds) {
  std::vector<uint8_t> levels(similarity.size());
  for (const float threshold : thresholds) {  // a pass each, which the compiler makes vectors of
    for (size_t i = 0; i < levels.size(); ++i) levels[i] += similarity[i] > threshold ? 1 : 0;
  }
  return levels;
}

MaskGrid::MaskGrid(std::vector<float> thresholds) : thresholds_(std::move(thresholds)) {
  assert(!thresholds_.empty() && thresholds_.size() <= 255);
}

void MaskGrid::AddScale(std::span<const float> positive, std::span<const float> negative) {
  std::vector<float> inside(positive.begin(), positive.end());
  for (size_t i = 0; i < inside.size(); ++i) {
    inside[i] = positive[i] > negative[i] ? positive[i] : -std::numeric_limits<float>::infinity();
  }
  std::vector<uint8_t>& levels = levels_.emplace_back(LevelsOf(inside, thresholds_));
  std::vector<int64_t>& areas = areas_.emplace_back(thresholds_.size());
  for (const uint8_t level : levels) {
    if (level > 0) ++areas[level - 1];
  }
  for (size_t j = areas.size() - 1; j > 0; --j) areas[j - 1] += areas[j];
}

int64_t MaskGrid::Area(const Cell& cell) const { return areas_[cell.scale][cell.threshold]; }

double MaskGrid::Iou(const Cell& a, const Cell& b) const {
  return IouIn(OverlapOf(a.scale, b.scale), a, b);
}

MaskGrid::Overlap MaskGrid::OverlapOf(int scale, int other) const {
  const int side = num_thresholds() + 1;
  Overlap counts(static_cast<size_t>(side) * side);
  const std::vector<uint8_t>&a = levels_[scale], &b = levels_[other];
  for (size_t i = 0; i < a.size(); ++i) ++counts[a[i] * side + b[i]];
  for (int i = side - 1; i >= 0; --i) {
    for (int j = side - 1; j >= 0; --j) {
      int64_t& at = counts[i * side + j];
      if (i + 1 < side) at += counts[(i + 1) * side + j];
      if (j + 1 < side) at += counts[i * side + j + 1];
      if (i + 1 < side && j + 1 < side) at -= counts[(i + 1) * side + j + 1];
    }
  }
  return counts;
}

double MaskGrid::IouIn(const Overlap& overlap, const Cell& a, const Cell& b) const {
  const int side = num_thresholds() + 1;
  const int64_t common = overlap[(a.threshold + 1) * side + b.threshold + 1];
  const int64_t either = Area(a) + Area(b) - common;
  return either == 0 ? 0 : static_cast<double>(common) / static_cast<double>(either);
}

// What no mask covers says nothing of two masks.
void MaskGrid::KeepPixelsInAnyMask() {
  if (levels_.empty()) return;
  size_t num_kept = 0;
  for (size_t i = 0; i < levels_[0].size(); ++i) {
    const bool in_any = std::any_of(levels_.begin(), levels_.end(),
                                    [i](const auto& levels) { return levels[i] > 0; });
    if (!in_any) continue;
    for (auto& levels : levels_) levels[num_kept] = levels[i];
    ++num_kept;
  }
  for (auto& levels : levels_) levels.resize(num_kept);
}

std::vector<double> MaskGrid::Stabilities() const {
  const int num = num_thresholds();
  std::vector<double> sum(static_cast<size_t>(num_scales()) * num);
  std::vector<int> count(sum.size());
  const auto add = [&](const Overlap& overlap, const Cell& a, const Cell& b) {
    const double iou = IouIn(overlap, a, b);
    for (const Cell& cell : {a, b}) {
      sum[cell.scale * num + cell.threshold] += iou;
      ++count[cell.scale * num + cell.threshold];
    }
  };
  for (int i = 0; i < num_scales(); ++i) {
    const Overlap own = OverlapOf(i, i);
    for (int j = 0; j + 1 < num; ++j) add(own, {i, j}, {i, j + 1});
    if (i + 1 == num_scales()) break;
    const Overlap next = OverlapOf(i, i + 1);
    for (int j = 0; j < num; ++j) add(next, {i, j}, {i + 1, j});
  }
  for (size_t k = 0; k < sum.size(); ++k) sum[k] /= std::max(1, count[k]);
  return sum;
}

std::vector<MaskGrid::Plateau> MaskGrid::FindPlateaus(int64_t min_area, int max_count) {
  KeepPixelsInAnyMask();
  const std::vector<double> stability = Stabilities();
  std::vector<size_t> left;  // cells, the most stable first
  for (size_t k = 0; k < stability.size(); ++k) {
    if (Area(CellAt(k)) >= min_area) left.push_back(k);
  }
  std::stable_sort(left.begin(), left.end(),
                   [&](size_t a, size_t b) { return stability[a] > stability[b]; });
  std::vector<Plateau> plateaus;
  std::vector<std::vector<Overlap>> overlaps_of(levels_.size());  // of a scale with all, once
  while (!left.empty()) {
    const Cell best = CellAt(left.front());
    std::vector<Overlap>& overlaps = overlaps_of[best.scale];
    for (auto i = static_cast<int>(overlaps.size()); i < num_scales(); ++i) {
      overlaps.push_back(OverlapOf(best.scale, i));
    }
    const double before = static_cast<double>(left.size()), first = stability[left.front()];
    std::erase_if(left, [&](size_t k) {
      const Cell cell = CellAt(k);
      return IouIn(overlaps[cell.scale], best, cell) > kSameMask;
    });
    const double support =
        (before - static_cast<double>(left.size())) / static_cast<double>(stability.size());
    plateaus.push_back({best, first, support});
  }
  std::stable_sort(plateaus.begin(), plateaus.end(),
                   [](const Plateau& a, const Plateau& b) { return a.support > b.support; });
  if (plateaus.size() > static_cast<size_t>(max_count)) plateaus.resize(max_count);
  return plateaus;
}

}  // namespace pepeseg
