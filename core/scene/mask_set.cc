#include "core/scene/mask_set.h"

#include <algorithm>
#include <cassert>
#include <map>
#include <utility>

namespace pepeseg {
namespace {

// Bits of one mask over all pixels, packed: the IoU of two is then a popcount.
using PixelBits = std::vector<uint64_t>;

PixelBits Pack(const BinaryMask& mask) {
  PixelBits bits((mask.pixels.size() + 63) / 64, 0);
  for (size_t i = 0; i < mask.pixels.size(); ++i) {
    if (mask.pixels[i] != 0) bits[i / 64] |= uint64_t{1} << (i % 64);
  }
  return bits;
}

int64_t CountBits(const PixelBits& bits) {
  int64_t count = 0;
  for (const uint64_t word : bits) count += __builtin_popcountll(word);
  return count;
}

int64_t CountShared(const PixelBits& a, const PixelBits& b) {
  int64_t count = 0;
  for (size_t i = 0; i < a.size(); ++i) count += __builtin_popcountll(a[i] & b[i]);
  return count;
}

bool IsDuplicate(const PixelBits& mask, int64_t area, const std::vector<PixelBits>& kept,
                 const std::vector<int64_t>& kept_area, double duplicate_iou) {
  for (size_t k = 0; k < kept.size(); ++k) {
    // No overlap can lift the IoU of two areas over their ratio.
    const auto small = static_cast<double>(std::min(area, kept_area[k]));
    const auto large = static_cast<double>(std::max(area, kept_area[k]));
    if (small <= duplicate_iou * large) continue;
    const auto shared = static_cast<double>(CountShared(mask, kept[k]));
    if (shared > duplicate_iou * (small + large - shared)) return true;
  }
  return false;
}

}  // namespace

std::span<const uint64_t> MaskSet::BitsAt(int x, int y) const {
  assert(x >= 0 && x < width && y >= 0 && y < height);
  const size_t pixel = static_cast<size_t>(y) * width + x;
  const size_t patch = pixel_patch.empty() ? 0 : pixel_patch[pixel];
  return std::span(patch_bits).subspan(patch * words, words);
}

bool MaskSet::Covers(int mask, int x, int y) const {
  assert(mask >= 0 && mask < num_masks);
  return ((BitsAt(x, y)[mask / 64] >> (mask % 64)) & 1) != 0;
}

BinaryMask MaskSet::Extract(int mask) const {
  assert(mask >= 0 && mask < num_masks);
  BinaryMask out;
  out.pixels.resize(static_cast<size_t>(width) * height);
  for (size_t i = 0; i < pixel_patch.size(); ++i) {
    const size_t word = static_cast<size_t>(pixel_patch[i]) * words + mask / 64;
    out.pixels[i] = (patch_bits[word] >> (mask % 64)) & 1;
  }
  return out;
}

MaskSet BuildMaskSet(int width, int height, std::span<const BinaryMask> masks,
                     double duplicate_iou) {
  const size_t num_pixels = static_cast<size_t>(width) * height;
  std::vector<PixelBits> kept;
  MaskSet out;
  out.width = width;
  out.height = height;
  for (const BinaryMask& mask : masks) {
    assert(mask.pixels.size() == num_pixels);
    PixelBits bits = Pack(mask);
    const int64_t area = CountBits(bits);
    if (area == 0 || IsDuplicate(bits, area, kept, out.mask_area, duplicate_iou)) continue;
    kept.push_back(std::move(bits));
    out.mask_area.push_back(area);
  }
  out.num_masks = static_cast<int>(kept.size());
  out.words = (out.num_masks + 63) / 64;
  if (out.words == 0) out.words = 1;
  out.patch_bits.assign(out.words, 0);
  if (kept.empty()) return out;

  std::map<std::vector<uint64_t>, uint32_t> patch_of_bits = {{out.patch_bits, 0}};
  out.pixel_patch.resize(num_pixels);
  std::vector<uint64_t> bits(out.words);
  for (size_t i = 0; i < num_pixels; ++i) {
    bits.assign(out.words, 0);
    for (size_t k = 0; k < kept.size(); ++k) {
      bits[k / 64] |= ((kept[k][i / 64] >> (i % 64)) & 1) << (k % 64);
    }
    const auto [entry, is_new] = patch_of_bits.try_emplace(bits, out.num_patches());
    if (is_new) out.patch_bits.insert(out.patch_bits.end(), bits.begin(), bits.end());
    out.pixel_patch[i] = entry->second;
  }
  return out;
}

}  // namespace pepeseg
