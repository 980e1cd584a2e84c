#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace pepeseg {

// One binary mask of a view, row-major [height, width], 0 or 1.
struct BinaryMask {
  std::vector<uint8_t> pixels;
};

// Consecutive pixels of a raster in reading order: indices y * width + x from `first` to before
// `last`.
struct PixelRun {
  uint32_t first = 0, last = 0;
  bool operator==(const PixelRun&) const = default;
};

// The overlapping masks of one view as a map of mask cells. Pixels that are covered by the same set
// of masks share a cell, and a cell has one bitset: the masks that cover it (METHOD.md section 0).
// This holds thousands of masks in little more than one raster. Cell 0 is covered by no mask.
struct MaskSet {
  int width = 0;
  int height = 0;
  int num_masks = 0;
  int words = 0;                     // 64-bit words of a bitset: max(1, ceil(num_masks / 64))
  std::vector<uint32_t> pixel_cell;  // [height, width], cell of each pixel; empty without masks
  std::vector<uint64_t> cell_bits;   // [num_cells, words]: bit m is set if mask m covers it
  std::vector<int64_t> mask_area;    // [num_masks], pixels

  bool empty() const { return num_masks == 0; }
  int num_cells() const { return words == 0 ? 0 : static_cast<int>(cell_bits.size()) / words; }
  // Returns the bitset of the masks that cover a pixel. 0 <= x < width, 0 <= y < height.
  std::span<const uint64_t> BitsAt(int x, int y) const;
  // Returns true if the mask covers the pixel. 0 <= mask < num_masks.
  bool Covers(int mask, int x, int y) const;
  // Returns the raster of one mask.
  BinaryMask Extract(int mask) const;
};

// Returns the pixels of each mask as ascending runs that do not touch, without the pixels where
// `ignore` is not 0: [height, width], or empty. Takes much less time than Extract for each mask.
std::vector<std::vector<PixelRun>> RunsOfMasks(const MaskSet& masks,
                                               std::span<const uint8_t> ignore = {});

// Builds a MaskSet of masks that are each [height, width]. Drops empty masks, and those whose IoU
// with a mask before them that was kept exceeds `duplicate_iou`.
MaskSet BuildMaskSet(int width, int height, std::span<const BinaryMask> masks,
                     double duplicate_iou = 0.95);

// Resamples masks to another pixel grid: pixel i of the result, which is [height, width], is
// covered by the masks that cover pixel source_pixel[i] of `masks`. Drops masks that no pixel is
// left of.
MaskSet ResampleMaskSet(const MaskSet& masks, int width, int height,
                        std::span<const int32_t> source_pixel);

// Builds a MaskSet one mask at a time, without a raster of each. Adding a mask takes time
// proportional to its area.
class MaskSetBuilder {
 public:
  MaskSetBuilder(int width, int height, double duplicate_iou = 0.95);

  // Adds the mask with these pixels: indices y * width + x, each once. Returns false if the mask
  // was dropped because it is empty or a duplicate (see BuildMaskSet).
  bool Add(std::span<const uint32_t> pixels);
  // The same for a mask of runs, none of which may overlap another.
  bool AddRuns(std::span<const PixelRun> runs);
  // Returns the size of all bitsets in bytes, so that callers can limit what an upload may request.
  int64_t BitsetBytes() const { return static_cast<int64_t>(set_.cell_bits.size()) * 8; }
  // Returns the set, with its cells numbered in raster order.
  MaskSet Build() &&;

 private:
  // for_each_run calls its argument with the first pixel of each run and that after its last.
  template <class ForEachRun>
  bool AddMask(int64_t area, const ForEachRun& for_each_run);
  bool IsDuplicate(int64_t area) const;
  uint32_t PatchWith(uint32_t cell, uint64_t bit, int word);
  void GrowWords();

  double duplicate_iou_;
  MaskSet set_;
  std::vector<int64_t> patch_area_;  // [num_cells], pixels
  // State of Add, kept between calls to reuse its memory:
  std::vector<int64_t> inside_;        // [num_cells], pixels of the cell that the mask covers
  std::vector<uint32_t> touched_;      // cells with inside_ > 0
  std::vector<uint32_t> replacement_;  // [num_cells], the cell that those pixels move to
};

}  // namespace pepeseg
