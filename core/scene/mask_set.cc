#include "core/scene/mask_set.h"

#include <algorithm>
#include <bit>
#include <cassert>
#include <cstddef>
#include <utility>

namespace pepeseg {
namespace {

// Renumbers the cells in raster order, with cell 0 (no mask) first, and drops those without a
// pixel.
void RenumberPatches(MaskSet& set) {
  std::vector<uint32_t> renumbered(set.num_patches(), 0);
  std::vector<uint64_t> bits(set.patch_bits.begin(), set.patch_bits.begin() + set.words);
  uint32_t next = 1;
  for (uint32_t& patch : set.pixel_patch) {
    if (patch == 0) continue;
    if (renumbered[patch] == 0) {
      renumbered[patch] = next++;
      const auto row = set.patch_bits.begin() + static_cast<ptrdiff_t>(patch) * set.words;
      bits.insert(bits.end(), row, row + set.words);
    }
    patch = renumbered[patch];
  }
  set.patch_bits = std::move(bits);
}

// Returns the indices of the mask's pixels.
std::vector<uint32_t> SetPixels(const BinaryMask& mask) {
  std::vector<uint32_t> pixels;
  for (size_t i = 0; i < mask.pixels.size(); ++i) {
    if (mask.pixels[i] != 0) pixels.push_back(static_cast<uint32_t>(i));
  }
  return pixels;
}

}  // namespace

std::span<const uint64_t> MaskSet::BitsAt(int x, int y) const {
  assert(x >= 0 && x < width && y >= 0 && y < height);
  const size_t patch = pixel_patch.empty() ? 0 : pixel_patch[static_cast<size_t>(y) * width + x];
  return {patch_bits.data() + patch * words, static_cast<size_t>(words)};
}

bool MaskSet::Covers(int mask, int x, int y) const {
  assert(mask >= 0 && mask < num_masks);
  return (BitsAt(x, y)[mask / 64] >> (mask % 64) & 1) != 0;
}

BinaryMask MaskSet::Extract(int mask) const {
  assert(mask >= 0 && mask < num_masks);
  BinaryMask result;
  result.pixels.reserve(pixel_patch.size());
  for (const uint32_t patch : pixel_patch) {
    const uint64_t word = patch_bits[static_cast<size_t>(patch) * words + mask / 64];
    result.pixels.push_back(word >> (mask % 64) & 1);
  }
  return result;
}

// Cuts the raster into runs of one cell; a mask has the runs of the cells that it covers.
std::vector<std::vector<PixelRun>> RunsOfMasks(const MaskSet& masks,
                                               std::span<const uint8_t> ignore) {
  std::vector<std::vector<PixelRun>> runs(static_cast<size_t>(masks.num_masks));
  const auto patch_of = [&](size_t pixel) {
    return ignore.empty() || ignore[pixel] == 0 ? masks.pixel_patch[pixel] : 0;
  };
  const size_t num_pixels = masks.pixel_patch.size();
  for (size_t first = 0, last = 0; first < num_pixels; first = last) {
    const uint32_t patch = patch_of(first);
    for (last = first + 1; last < num_pixels && patch_of(last) == patch;) ++last;
    for (int word = 0; word < masks.words; ++word) {
      uint64_t bits = masks.patch_bits[static_cast<size_t>(patch) * masks.words + word];
      for (; bits != 0; bits &= bits - 1) {
        auto& of_mask = runs[static_cast<size_t>(word * 64 + std::countr_zero(bits))];
        if (!of_mask.empty() && of_mask.back().last == first) {
          of_mask.back().last = static_cast<uint32_t>(last);
        } else {
          of_mask.push_back({static_cast<uint32_t>(first), static_cast<uint32_t>(last)});
        }
      }
    }
  }
  return runs;
}

MaskSetBuilder::MaskSetBuilder(int width, int height, double duplicate_iou)
    : duplicate_iou_(duplicate_iou) {
  set_.width = width;
  set_.height = height;
  set_.words = 1;
  set_.pixel_patch.assign(static_cast<size_t>(width) * height, 0);
  set_.patch_bits.assign(1, 0);
  patch_area_.assign(1, static_cast<int64_t>(width) * height);
}

// A mask splits each cell that it covers in part: its pixels move to a new cell, whose bitset is
// that of the old one plus the new mask. Cells that it covers in full only gain the mask's bit.
template <class ForEachRun>
bool MaskSetBuilder::AddMask(int64_t area, const ForEachRun& for_each_run) {
  if (area == 0) return false;
  inside_.resize(patch_area_.size(), 0);
  replacement_.resize(patch_area_.size());
  touched_.clear();
  // Most neighbours share a cell: pieces of a run within one cell are counted at once.
  for_each_run([this](uint32_t first, uint32_t last) {
    for (uint32_t end = first; first < last; first = end) {
      const uint32_t patch = set_.pixel_patch[first];
      for (end = first + 1; end < last && set_.pixel_patch[end] == patch;) ++end;
      if (inside_[patch] == 0) touched_.push_back(patch);
      inside_[patch] += end - first;
    }
  });
  // Now inside_ has the number of covered pixels of each touched cell.
  const bool keep = !IsDuplicate(area);
  if (keep) {
    const int mask = set_.num_masks++;
    if (mask / 64 >= set_.words) GrowWords();
    set_.mask_area.push_back(area);
    for (const uint32_t patch : touched_) {
      replacement_[patch] = PatchWith(patch, uint64_t{1} << (mask % 64), mask / 64);
    }
    for_each_run([this](uint32_t first, uint32_t last) {
      for (uint32_t pixel = first; pixel < last; ++pixel) {
        set_.pixel_patch[pixel] = replacement_[set_.pixel_patch[pixel]];
      }
    });
  }
  // Resets only the touched cells: the others are 0 already.
  for (const uint32_t patch : touched_) inside_[patch] = 0;
  return keep;
}

bool MaskSetBuilder::Add(std::span<const uint32_t> pixels) {
  return AddMask(static_cast<int64_t>(pixels.size()), [pixels](const auto& visit) {
    for (const uint32_t pixel : pixels) visit(pixel, pixel + 1);
  });
}

bool MaskSetBuilder::AddRuns(std::span<const PixelRun> runs) {
  int64_t area = 0;
  for (const PixelRun& run : runs) area += run.last - run.first;
  return AddMask(area, [runs](const auto& visit) {
    for (const PixelRun& run : runs) visit(run.first, run.last);
  });
}

// Computes the IoU with every kept mask. A mask covers a cell in full or not at all, so the
// intersection is the sum of `inside_` over the touched cells that the other mask covers.
bool MaskSetBuilder::IsDuplicate(int64_t area) const {
  std::vector<int64_t> common(set_.num_masks, 0);
  for (const uint32_t patch : touched_) {
    for (int word = 0; word < set_.words; ++word) {
      uint64_t bits = set_.patch_bits[static_cast<size_t>(patch) * set_.words + word];
      for (; bits != 0; bits &= bits - 1) {
        common[word * 64 + std::countr_zero(bits)] += inside_[patch];
      }
    }
  }
  for (int mask = 0; mask < set_.num_masks; ++mask) {
    const int64_t united = area + set_.mask_area[mask] - common[mask];
    if (static_cast<double>(common[mask]) > duplicate_iou_ * static_cast<double>(united)) {
      return true;
    }
  }
  return false;
}

// Adds the bit of the new mask to the pixels of `patch` that it covers, and returns their cell:
// `patch` itself if the mask covers all of it, else a new cell. Cell 0 is always split, because it
// must remain the cell without masks even when it has no pixel left.
uint32_t MaskSetBuilder::PatchWith(uint32_t patch, uint64_t bit, int word) {
  const size_t words = set_.words;
  if (patch != 0 && inside_[patch] == patch_area_[patch]) {
    set_.patch_bits[patch * words + word] |= bit;
    return patch;
  }
  const auto added = static_cast<uint32_t>(patch_area_.size());
  patch_area_[patch] -= inside_[patch];
  patch_area_.push_back(inside_[patch]);
  for (size_t i = 0; i < words; ++i) {
    const uint64_t bits = set_.patch_bits[patch * words + i];
    set_.patch_bits.push_back(bits);
  }
  set_.patch_bits[added * words + word] |= bit;
  return added;
}

// Makes room for 64 more masks in every bitset.
void MaskSetBuilder::GrowWords() {
  const size_t patches = patch_area_.size();
  const size_t words = set_.words;
  std::vector<uint64_t> grown(patches * (words + 1), 0);
  for (size_t patch = 0; patch < patches; ++patch) {
    std::copy_n(&set_.patch_bits[patch * words], words, &grown[patch * (words + 1)]);
  }
  set_.patch_bits = std::move(grown);
  ++set_.words;
}

MaskSet MaskSetBuilder::Build() && {
  if (set_.num_masks == 0) set_.pixel_patch.clear();
  RenumberPatches(set_);
  return std::move(set_);
}

MaskSet BuildMaskSet(int width, int height, std::span<const BinaryMask> masks,
                     double duplicate_iou) {
  MaskSetBuilder builder(width, height, duplicate_iou);
  for (const BinaryMask& mask : masks) {
    assert(mask.pixels.size() == static_cast<size_t>(width) * height);
    builder.Add(SetPixels(mask));
  }
  return std::move(builder).Build();
}

MaskSet ResampleMaskSet(const MaskSet& masks, int width, int height,
                        std::span<const int32_t> source_pixel) {
  assert(source_pixel.size() == static_cast<size_t>(width) * height);
  // Pixels of one cell have the same masks after resampling as well, so each mask is put together
  // from the resampled pixels of its cells.
  std::vector<std::vector<uint32_t>> pixels_of_patch(masks.num_patches());
  if (!masks.empty()) {
    for (size_t i = 0; i < source_pixel.size(); ++i) {
      const uint32_t patch = masks.pixel_patch[source_pixel[i]];
      if (patch != 0) pixels_of_patch[patch].push_back(static_cast<uint32_t>(i));
    }
  }
  MaskSetBuilder builder(width, height, /*duplicate_iou=*/1.0);
  for (int mask = 0; mask < masks.num_masks; ++mask) {
    std::vector<uint32_t> pixels;
    for (int patch = 1; patch < masks.num_patches(); ++patch) {
      const uint64_t word = masks.patch_bits[static_cast<size_t>(patch) * masks.words + mask / 64];
      if ((word >> (mask % 64) & 1) == 0) continue;
      pixels.insert(pixels.end(), pixels_of_patch[patch].begin(), pixels_of_patch[patch].end());
    }
    builder.Add(pixels);
  }
  return std::move(builder).Build();
}

}  // namespace pepeseg
