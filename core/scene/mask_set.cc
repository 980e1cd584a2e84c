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
  std::vector<uint32_t> renumbered(set.num_cells(), 0);
  std::vector<uint64_t> bits(set.cell_bits.begin(), set.cell_bits.begin() + set.words);
  uint32_t next = 1;
  for (uint32_t& cell : set.pixel_cell) {
    if (cell == 0) continue;
    if (renumbered[cell] == 0) {
      renumbered[cell] = next++;
      const auto row = set.cell_bits.begin() + static_cast<ptrdiff_t>(cell) * set.words;
      bits.insert(bits.end(), row, row + set.words);
    }
    cell = renumbered[cell];
  }
  set.cell_bits = std::move(bits);
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
  const size_t cell = pixel_cell.empty() ? 0 : pixel_cell[static_cast<size_t>(y) * width + x];
  return {cell_bits.data() + cell * words, static_cast<size_t>(words)};
}

bool MaskSet::Covers(int mask, int x, int y) const {
  assert(mask >= 0 && mask < num_masks);
  return (BitsAt(x, y)[mask / 64] >> (mask % 64) & 1) != 0;
}

BinaryMask MaskSet::Extract(int mask) const {
  assert(mask >= 0 && mask < num_masks);
  BinaryMask result;
  result.pixels.reserve(pixel_cell.size());
  for (const uint32_t cell : pixel_cell) {
    const uint64_t word = cell_bits[static_cast<size_t>(cell) * words + mask / 64];
    result.pixels.push_back(word >> (mask % 64) & 1);
  }
  return result;
}

// Cuts the raster into runs of one cell; a mask has the runs of the cells that it covers.
std::vector<std::vector<PixelRun>> RunsOfMasks(const MaskSet& masks,
                                               std::span<const uint8_t> ignore) {
  std::vector<std::vector<PixelRun>> runs(static_cast<size_t>(masks.num_masks));
  const auto patch_of = [&](size_t pixel) {
    return ignore.empty() || ignore[pixel] == 0 ? masks.pixel_cell[pixel] : 0;
  };
  const size_t num_pixels = masks.pixel_cell.size();
  for (size_t first = 0, last = 0; first < num_pixels; first = last) {
    const uint32_t cell = patch_of(first);
    for (last = first + 1; last < num_pixels && patch_of(last) == cell;) ++last;
    for (int word = 0; word < masks.words; ++word) {
      uint64_t bits = masks.cell_bits[static_cast<size_t>(cell) * masks.words + word];
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
  set_.pixel_cell.assign(static_cast<size_t>(width) * height, 0);
  set_.cell_bits.assign(1, 0);
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
      const uint32_t cell = set_.pixel_cell[first];
      for (end = first + 1; end < last && set_.pixel_cell[end] == cell;) ++end;
      if (inside_[cell] == 0) touched_.push_back(cell);
      inside_[cell] += end - first;
    }
  });
  // Now inside_ has the number of covered pixels of each touched cell.
  const bool keep = !IsDuplicate(area);
  if (keep) {
    const int mask = set_.num_masks++;
    if (mask / 64 >= set_.words) GrowWords();
    set_.mask_area.push_back(area);
    for (const uint32_t cell : touched_) {
      replacement_[cell] = PatchWith(cell, uint64_t{1} << (mask % 64), mask / 64);
    }
    for_each_run([this](uint32_t first, uint32_t last) {
      for (uint32_t pixel = first; pixel < last; ++pixel) {
        set_.pixel_cell[pixel] = replacement_[set_.pixel_cell[pixel]];
      }
    });
  }
  // Resets only the touched cells: the others are 0 already.
  for (const uint32_t cell : touched_) inside_[cell] = 0;
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
  for (const uint32_t cell : touched_) {
    for (int word = 0; word < set_.words; ++word) {
      uint64_t bits = set_.cell_bits[static_cast<size_t>(cell) * set_.words + word];
      for (; bits != 0; bits &= bits - 1) {
        common[word * 64 + std::countr_zero(bits)] += inside_[cell];
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

// Adds the bit of the new mask to the pixels of `cell` that it covers, and returns their cell:
// `cell` itself if the mask covers all of it, else a new cell. Cell 0 is always split, because it
// must remain the cell without masks even when it has no pixel left.
uint32_t MaskSetBuilder::PatchWith(uint32_t cell, uint64_t bit, int word) {
  const size_t words = set_.words;
  if (cell != 0 && inside_[cell] == patch_area_[cell]) {
    set_.cell_bits[cell * words + word] |= bit;
    return cell;
  }
  const auto added = static_cast<uint32_t>(patch_area_.size());
  patch_area_[cell] -= inside_[cell];
  patch_area_.push_back(inside_[cell]);
  for (size_t i = 0; i < words; ++i) {
    const uint64_t bits = set_.cell_bits[cell * words + i];
    set_.cell_bits.push_back(bits);
  }
  set_.cell_bits[added * words + word] |= bit;
  return added;
}

// Makes room for 64 more masks in every bitset.
void MaskSetBuilder::GrowWords() {
  const size_t cells = patch_area_.size();
  const size_t words = set_.words;
  std::vector<uint64_t> grown(cells * (words + 1), 0);
  for (size_t cell = 0; cell < cells; ++cell) {
    std::copy_n(&set_.cell_bits[cell * words], words, &grown[cell * (words + 1)]);
  }
  set_.cell_bits = std::move(grown);
  ++set_.words;
}

MaskSet MaskSetBuilder::Build() && {
  if (set_.num_masks == 0) set_.pixel_cell.clear();
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
  std::vector<std::vector<uint32_t>> pixels_of_patch(masks.num_cells());
  if (!masks.empty()) {
    for (size_t i = 0; i < source_pixel.size(); ++i) {
      const uint32_t cell = masks.pixel_cell[source_pixel[i]];
      if (cell != 0) pixels_of_patch[cell].push_back(static_cast<uint32_t>(i));
    }
  }
  MaskSetBuilder builder(width, height, /*duplicate_iou=*/1.0);
  for (int mask = 0; mask < masks.num_masks; ++mask) {
    std::vector<uint32_t> pixels;
    for (int cell = 1; cell < masks.num_cells(); ++cell) {
      const uint64_t word = masks.cell_bits[static_cast<size_t>(cell) * masks.words + mask / 64];
      if ((word >> (mask % 64) & 1) == 0) continue;
      pixels.insert(pixels.end(), pixels_of_patch[cell].begin(), pixels_of_patch[cell].end());
    }
    builder.Add(pixels);
  }
  return std::move(builder).Build();
}

}  // namespace pepeseg
