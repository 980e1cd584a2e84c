#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace pepeseg {

// Of each pixel, over how many of the thresholds it is, at most 255.
std::vector<uint8_t> LevelsOf(std::span<const float> similarity, std::span<const float> thresholds);

// The masks of one prompt at several scales and thresholds, and which of them are stable: a mask
// that hardly changes when scale and threshold do is a thing, one that changes with every step is
// an accident (method.md section 4, "Scale proposals").
class MaskGrid {
 public:
  // Ascending, at most 255.
  explicit MaskGrid(std::vector<float> thresholds);

  // The next larger scale: each pixel's similarity to what is meant, and to what is not; a pixel is
  // in a mask where the first is over the threshold and over the second. Scales have equally many
  // pixels.
  void AddScale(std::span<const float> positive, std::span<const float> negative);

  struct Cell {
    int scale = 0, threshold = 0;  // indices
  };
  int64_t Area(const Cell& cell) const;
  double Iou(const Cell& a, const Cell& b) const;

  struct Plateau {
    Cell cell;             // the most stable of the cells that show this mask
    double stability = 0;  // mean IoU of its mask with those beside it on the grid
    double support = 0;    // share of the grid's cells that show it: IoU with it over kSameMask
  };
  static constexpr double kSameMask = 0.8;
  // The distinct masks of at least `min_area` pixels, those with the most support first; at most
  // `max_count`.
  // No scale can be added afterwards.
  std::vector<Plateau> FindPlateaus(int64_t min_area, int max_count);

 private:
  // Pixels of two scales by both levels, summed up from the top: [a][b] pixels whose levels are
  // over a resp. b.
  using Overlap = std::vector<int64_t>;
  Overlap OverlapOf(int scale, int other) const;
  double IouIn(const Overlap& overlap, const Cell& a, const Cell& b) const;
  void KeepPixelsInAnyMask();
  std::vector<double> Stabilities() const;

  int num_thresholds() const { return static_cast<int>(thresholds_.size()); }
  int num_scales() const { return static_cast<int>(areas_.size()); }
  Cell CellAt(size_t index) const {
    return {static_cast<int>(index) / num_thresholds(), static_cast<int>(index) % num_thresholds()};
  }

  std::vector<float> thresholds_;
  // By scale: of each pixel, how many thresholds it is over; and of each threshold, how many pixels
  // are.
  std::vector<std::vector<uint8_t>> levels_;
  std::vector<std::vector<int64_t>> areas_;
};

}  // namespace pepeseg
