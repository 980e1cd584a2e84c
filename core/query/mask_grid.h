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
// an accident (method.md section 4, "Scale proposals").
class MaskGrid {
 public:
  explicit MaskGrid(LevelCounts counts);

  struct Cell {
    int scale = 0, threshold = 0;  // indices
  };
  int64_t Area(const Cell& cell) const { return Common(cell, cell); }
  double Iou(const Cell& a, const Cell& b) const;

  struct Plateau {
    Cell cell;             // the most stable of the cells that show this mask
    double stability = 0;  // mean IoU of its mask with those beside it on the grid
    double support = 0;    // share of the grid's cells that show it: IoU with it over kSameMask
  };
  static constexpr double kSameMask = 0.8;
  // The distinct masks of at least `min_area` pixels, those with the most support first; at most
  // `max_count`.
  std::vector<Plateau> FindPlateaus(int64_t min_area, int max_count) const;

 private:
  int64_t Common(const Cell& a, const Cell& b) const;  // pixels in both masks
  std::vector<double> Stabilities() const;

  Cell CellAt(size_t index) const {
    return {static_cast<int>(index) / counts_.num_thresholds,
            static_cast<int>(index) % counts_.num_thresholds};
  }

  LevelCounts counts_;  // summed up from the top: pixels whose levels are at least these
};

}  // namespace pepeseg
