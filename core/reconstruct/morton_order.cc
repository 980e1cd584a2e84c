#include "core/reconstruct/morton_order.h"

#include <algorithm>
#include <utility>

namespace pepeseg {
namespace {

constexpr int kBits = 21;  // an axis: three fit 64 bits

// Two zero bits between any two of the low 21 bits.
uint64_t SpreadBits(uint64_t x) {
  x &= 0x1fffff;
  x = (x | x << 32) & 0x001f00000000ffff;
  x = (x | x << 16) & 0x001f0000ff0000ff;
  x = (x | x << 8) & 0x100f00f00f00f00f;
  x = (x | x << 4) & 0x10c30c30c30c30c3;
  return (x | x << 2) & 0x1249249249249249;
}

}  // namespace

std::vector<int64_t> MortonOrder(std::span<const float> means) {
  const size_t count = means.size() / 3;
  std::vector<std::pair<uint64_t, int64_t>> codes(count);
  for (size_t i = 0; i < count; ++i) codes[i].second = static_cast<int64_t>(i);
  for (size_t axis = 0; axis < 3; ++axis) {
    const std::span<const float> plane = means.subspan(axis * count, count);
    if (plane.empty()) break;
    const auto [min, max] = std::minmax_element(plane.begin(), plane.end());
    const double cells = (1 << kBits) - 1;
    const double per_unit = *max > *min ? cells / (double{*max} - *min) : 0;
    for (size_t i = 0; i < count; ++i) {
      // A mean that is not finite (never rendered) goes to the first cell.
      const double cell = (double{plane[i]} - *min) * per_unit;
      const auto bits = cell >= 0 && cell <= cells ? static_cast<uint64_t>(cell) : 0;
      codes[i].first |= SpreadBits(bits) << axis;
    }
  }
  std::sort(codes.begin(), codes.end());
  std::vector<int64_t> order;
  order.reserve(count);
  for (const auto& [code, index] : codes) order.push_back(index);
  return order;
}

}  // namespace pepeseg
