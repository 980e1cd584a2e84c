#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace pepeseg {

// Pixel counts from which the overlap of any two masks of one prompt follows. The masks are those
// at several scales and thresholds, both ascending.
struct LevelCounts {
  int num_scales = 0, num_thresholds = 0;
  // [num_scales, num_scales, num_thresholds + 1, num_thresholds + 1], see LevelOverlapsArgs.
  std::vector<int32_t> pixels;
};

// The masks of one prompt on a grid of scales and thresholds, and which of them are stable. A mask
// that hardly changes over many scales and thresholds shows a thing; one that changes with every
// step does not (METHOD.md section 4, "Scale proposals").
class MaskGrid {
 public:
  explicit MaskGrid(LevelCounts counts);

  struct Cell {
    int scale = 0, threshold = 0;  // indices
  };
  // Returns the number of pixels in the mask of a cell.
  int64_t Area(const Cell& cell) const { return Common(cell, cell); }
  // Returns the IoU of the masks of two cells, 0 if both are empty.
  double Iou(const Cell& a, const Cell& b) const;
  // Returns the number of pixels in both masks.
  int64_t Common(const Cell& a, const Cell& b) const;
  // Returns the mean IoU of the cell's mask with those of its neighbours on the grid, [0, 1].
  double Stability(const Cell& cell) const { return stability_[IndexOf(cell)]; }
  int num_scales() const { return counts_.num_scales; }
  int num_thresholds() const { return counts_.num_thresholds; }

  struct Plateau {
    Cell cell;             // the most stable cell that shows this mask
    double stability = 0;  // stability of `cell`
    double support = 0;    // share of the grid's cells that show it
  };
  // IoU over which two cells show the same mask.
  static constexpr double kSameMask = 0.8;
  // Returns at most `max_count` distinct masks of at least `min_area` pixels, most support first.
  // Greedy: takes the most stable cell left and removes all cells that show the same mask.
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

  LevelCounts counts_;             // cumulative: pixels whose levels are at least these
  std::vector<double> stability_;  // [num_scales, num_thresholds]
};

}  // namespace pepeseg
