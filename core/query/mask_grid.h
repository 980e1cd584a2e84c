#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace pepeseg {

// How the masks of one prompt at several scales and thresholds overlap, both ascending.
struct LevelCounts {
  int num_scales = 0, num_thresholds = 0;
  // [num_scales, num_scales, num_thresholds + 1, num_thresholds + 1], see LevelOverlapsArgs.
  std::vector<int32_t> pixels;
};

// The masks of one prompt at several scales and thresholds, and which of them are stable: a mask
// that hardly changes when scale and threshold do is a thing, one that changes with every step is
// an accident (METHOD.md section 4, "Scale proposals").
class MaskGrid {
 public:
  explicit MaskGrid(LevelCounts counts);

  struct Cell {
    int scale = 0, threshold = 0;  // indices
  };
  int64_t Area(const Cell& cell) const { return Common(cell, cell); }
  double Iou(const Cell& a, const Cell& b) const;
  // Pixels in both masks.
  int64_t Common(const Cell& a, const Cell& b) const;
  // Mean IoU of the cell's mask with those beside it on the grid, [0, 1].
  double Stability(const Cell& cell) const { return stability_[IndexOf(cell)]; }
  int num_scales() const { return counts_.num_scales; }
  int num_thresholds() const { return counts_.num_thresholds; }

  struct Plateau {
    Cell cell;             // the most stable of the cells that show this mask
    double stability = 0;  // of the cell
    double support = 0;    // share of the grid's cells that show it: IoU with it over kSameMask
  };
  static constexpr double kSameMask = 0.8;
  // The distinct masks of at least `min_area` pixels, those with the most support first; at most
  // `max_count`.
  std::vector<Plateau> FindPlateaus(int64_t min_area, int max_count) const;

 private:
  std::vector<double> Stabilities() const;

  size_t IndexOf(const Cell& cell) const {
    return static_cast<size_t>(cell.scale) * counts_.num_thresholds + cell.threshold;
  }
  Cell CellAt(size_t index) const {
    return {static_cast<int>(index) / counts_.num_thresholds,
            static_cast<int>(index) % counts_.num_thresholds};
  }

  LevelCounts counts_;             // summed up from the top: pixels whose levels are at least these
  std::vector<double> stability_;  // [num_scales, num_thresholds]
};

}  // namespace pepeseg
