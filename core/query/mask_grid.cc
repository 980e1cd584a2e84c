#include "core/query/mask_grid.h"

#include <algorithm>
#include <cassert>
#include <utility>

namespace pepeseg {
namespace {

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

}  // namespace

MaskGrid::MaskGrid(LevelCounts counts) : counts_(std::move(counts)) {
  const size_t side = counts_.num_thresholds + 1;
  assert(counts_.pixels.size() ==
         side * side * static_cast<size_t>(counts_.num_scales) * counts_.num_scales);
  for (size_t pair = 0; pair < counts_.pixels.size(); pair += side * side) {
    SumFromTop(&counts_.pixels[pair], static_cast<int>(side));
  }
  stability_ = Stabilities();
}

int64_t MaskGrid::Common(const Cell& a, const Cell& b) const {
  if (a.scale > b.scale) return Common(b, a);
  const size_t side = counts_.num_thresholds + 1;
  const size_t pair = static_cast<size_t>(a.scale) * counts_.num_scales + b.scale;
  return counts_.pixels[(pair * side + a.threshold + 1) * side + b.threshold + 1];
}

double MaskGrid::Iou(const Cell& a, const Cell& b) const {
  const int64_t common = Common(a, b), either = Area(a) + Area(b) - common;
  return either == 0 ? 0 : static_cast<double>(common) / static_cast<double>(either);
}

std::vector<double> MaskGrid::Stabilities() const {
  const int num = counts_.num_thresholds;
  std::vector<double> sum(static_cast<size_t>(counts_.num_scales) * num);
  std::vector<int> count(sum.size());
  const auto add = [&](const Cell& a, const Cell& b) {
    const double iou = Iou(a, b);
    for (const Cell& cell : {a, b}) {
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

std::vector<MaskGrid::Plateau> MaskGrid::FindPlateaus(int64_t min_area, int max_count) const {
  std::vector<size_t> left;  // cells, the most stable first
  for (size_t k = 0; k < stability_.size(); ++k) {
    if (Area(CellAt(k)) >= min_area) left.push_back(k);
  }
  std::stable_sort(left.begin(), left.end(),
                   [&](size_t a, size_t b) { return stability_[a] > stability_[b]; });
  std::vector<Plateau> plateaus;
  while (!left.empty()) {
    const Cell best = CellAt(left.front());
    const double before = static_cast<double>(left.size()), first = stability_[left.front()];
    std::erase_if(left, [&](size_t k) { return Iou(best, CellAt(k)) > kSameMask; });
    const double support =
        (before - static_cast<double>(left.size())) / static_cast<double>(stability_.size());
    plateaus.push_back({best, first, support});
  }
  std::stable_sort(plateaus.begin(), plateaus.end(),
                   [](const Plateau& a, const Plateau& b) { return a.support > b.support; });
  if (plateaus.size() > static_cast<size_t>(max_count)) plateaus.resize(max_count);
  return plateaus;
}

}  // namespace pepeseg
