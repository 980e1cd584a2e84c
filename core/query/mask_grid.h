#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/query/mask_geometry.h"
#include "core/query/prompt.h"
#include "core/query/view_features.h"

// Scale and threshold of a prompt are chosen by comparing masks at many of them, on a view that is
// small enough for that.

namespace pepeseg {

// The scales (quantiles) and thresholds (cosines) to compare, both ascending.
struct GranularityGrid {
  std::vector<double> scales;
  std::vector<float> thresholds;
};
// Returns the grid for `granularity`: a scale or threshold that it gives is the only one.
GranularityGrid GridOf(const Granularity& granularity);

// Returns, for each pixel, how many of the thresholds its similarity exceeds. At most 255
// thresholds.
std::vector<uint8_t> LevelsOf(std::span<const float> similarity, std::span<const float> thresholds);

// Maximum size of a view on which masks are compared, pixels.
inline constexpr int64_t kMaxLookPixels = 262'144;
// A view shrunk by a whole factor. Its pixel (x, y) covers the `factor` x `factor` pixels of the
// original view that start at (factor * x, factor * y).
struct SmallView {
  ModelView view;
  int factor = 1;

  // Returns the pixel that covers pixel (x, y) of the original view, or the nearest one.
  PixelIndex PixelAt(int x, int y) const {
    return {std::min(view.camera.width - 1, x / factor),
            std::min(view.camera.height - 1, y / factor)};
  }
};
// Returns the view shrunk by the smallest whole factor that leaves at most kMaxLookPixels.
SmallView SmallViewOf(const ModelView& view);

// Indices of a scale and a threshold of a grid.
struct GridCell {
  int scale = 0, threshold = 0;
};
// A scale and a threshold at which a prompt shows something stable.
struct Candidate {
  double scale = 0;      // quantile, [0, 1]
  double threshold = 0;  // cosine, [-1, 1]
  double stability = 0;  // [0, 1], see MaskGrid::Stability
  double support = 0;    // (0, 1], share of all scales and thresholds that show the same mask
  GridCell cell;         // of the scale and the threshold
};
// The things that a prompt may mean, smallest first: a part, the object that has it, a group.
struct Candidates {
  // Each mask has at least kMinGrowth times the area of the one before, holds at least kMinHeld of
  // its pixels, and has the same scale or a larger one.
  std::vector<Candidate> list;
  int best = 0;  // index of the one that ResolvePrompt chooses

  // Returns the indices of the candidates, most support first; of equal ones the smaller first.
  std::vector<size_t> BySupport() const;

  static constexpr double kMinGrowth = 1.5;
  static constexpr double kMinHeld = 0.95;
};

// The masks of one prompt on a grid of scales and thresholds, and which of them are stable. A mask
// that hardly changes over many scales and thresholds shows a thing; one that changes with every
// step does not (METHOD.md section 4, "Scale proposals").
class MaskGrid {
 public:
  // counts: of the scales and thresholds of `grid`.
  MaskGrid(LevelCounts counts, GranularityGrid grid);

  // Returns the number of pixels in the mask of a cell.
  int64_t Area(const GridCell& cell) const;
  // Returns the IoU of the masks of two cells, 0 if both are empty.
  double Iou(const GridCell& a, const GridCell& b) const;
  // Returns the number of pixels in both masks.
  int64_t Common(const GridCell& a, const GridCell& b) const;
  // Returns the mean IoU of the cell's mask with those of its neighbours on the grid, [0, 1].
  double Stability(const GridCell& cell) const;
  int num_scales() const { return counts_.num_scales; }
  int num_thresholds() const { return counts_.num_thresholds; }

  // IoU over which two cells show the same mask.
  static constexpr double kSameMask = 0.8;
  // Returns at most `max_count` distinct masks of at least `min_area` pixels, most support first.
  // Greedy: takes the most stable cell left and removes all cells that show the same mask.
  std::vector<Candidate> FindPlateaus(int64_t min_area, int max_count) const;
  // Returns the granularity of a cell, whose mask has this support.
  Candidate CandidateAt(const GridCell& cell, double support) const;

 private:
  std::vector<double> Stabilities() const;

  size_t IndexOf(const GridCell& cell) const;
  GridCell CellAt(size_t index) const;

  GranularityGrid grid_;
  LevelCounts counts_;             // cumulative: pixels whose levels are at least these
  std::vector<double> stability_;  // [num_scales, num_thresholds]
};

// Returns the candidates with the most total support among those that contain the plateau at index
// `best` of `plateaus` (all plateaus of MaskGrid::FindPlateaus): at most `max_count`, and none if
// there are no plateaus. Many cells of the grid may show the same mask: each candidate is a cell
// that keeps the list nested. The best one's cell shows the mask of its plateau's most stable cell,
// the other cells have an IoU of at least 0.9 with theirs. A plateau of a single cell is a
// candidate only if it is the best.
Candidates FindCandidates(const MaskGrid& masks, std::span<const Candidate> plateaus, size_t best,
                          int max_count);

}  // namespace pepeseg
