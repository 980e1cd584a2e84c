#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace pepeseg {

// One binary mask of a view, row-major [height, width], 0 or 1.
struct BinaryMask {
  std::vector<uint8_t> pixels;
};

// The overlapping masks of one view as a patch map: pixels that the same set of masks covers share
// a patch, and each patch has the bitset of its masks (METHOD.md section 0). Patch 0 is covered by
// no mask.
struct MaskSet {
  int width = 0;
  int height = 0;
  int num_masks = 0;
  int words = 0;                      // 64-bit words of a bitset: ceil(num_masks / 64), >= 1
  std::vector<uint32_t> pixel_patch;  // [height * width]; empty when the view has no masks at all
  std::vector<uint64_t> patch_bits;   // [num_patches, words]
  std::vector<int64_t> mask_area;     // [num_masks] pixels

  bool empty() const { return num_masks == 0; }
  int num_patches() const { return words == 0 ? 0 : static_cast<int>(patch_bits.size()) / words; }
  std::span<const uint64_t> BitsAt(int x, int y) const;
  bool Covers(int mask, int x, int y) const;
  BinaryMask Extract(int mask) const;
};

// Masks whose IoU with one that is already kept is over `duplicate_iou` are dropped, as are empty
// ones. Every mask must be [height, width].
MaskSet BuildMaskSet(int width, int height, std::span<const BinaryMask> masks,
                     double duplicate_iou = 0.95);

// The same masks seen through another pixel grid: pixel i of the result [height, width] takes what
// pixel source_pixel[i] of `masks` has. Masks that no pixel shows any more are dropped.
MaskSet ResampleMaskSet(const MaskSet& masks, int width, int height,
                        std::span<const int32_t> source_pixel);

// Builds a MaskSet one mask at a time, in time proportional to the masks' areas: no raster of a
// mask is kept.
class MaskSetBuilder {
 public:
  MaskSetBuilder(int width, int height, double duplicate_iou = 0.95);

  // `pixels`: the indices y * width + x of the mask, each once. False when the mask was dropped.
  bool Add(std::span<const uint32_t> pixels);
  // What the bitsets hold now, for a limit on what an upload may ask for.
  int64_t BitsetBytes() const { return static_cast<int64_t>(set_.patch_bits.size()) * 8; }
  // Patches are numbered in the order in which the rows of the image meet them.
  MaskSet Build() &&;

 private:
  bool IsDuplicate(int64_t area) const;
  uint32_t PatchWith(uint32_t patch, uint64_t bit, int word);
  void GrowWords();

  double duplicate_iou_;
  MaskSet set_;
  std::vector<int64_t> patch_area_;    // [num_patches] pixels
  std::vector<int64_t> inside_;        // [num_patches] pixels in the mask being added
  std::vector<uint32_t> touched_;      // patches with inside_ > 0
  std::vector<uint32_t> replacement_;  // [num_patches] where inside_ pixels go
};

}  // namespace pepeseg
