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
// a patch, and each patch has the bitset of its masks (method.md section 0). Patch 0 is covered by
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

}  // namespace pepeseg
