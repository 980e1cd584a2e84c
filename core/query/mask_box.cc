#include "core/query/mask_box.h"

#include <algorithm>
#include <iterator>

namespace pepeseg {

void FindBox(std::span<const uint8_t> mask, int width, int (&box)[4]) {
  const int height = static_cast<int>(mask.size()) / width;
  int min_x = width, max_x = -1, min_y = height, max_y = -1;
  for (int y = 0; y < height; ++y) {
    const std::span<const uint8_t> row = mask.subspan(static_cast<size_t>(y) * width, width);
    const auto first = std::find(row.begin(), row.end(), uint8_t{1});
    if (first == row.end()) continue;
    const auto last = std::find(row.rbegin(), row.rend(), uint8_t{1});
    min_x = std::min(min_x, static_cast<int>(first - row.begin()));
    max_x = std::max(max_x, width - 1 - static_cast<int>(last - row.rbegin()));
    min_y = std::min(min_y, y);
    max_y = y;
  }
  std::fill(std::begin(box), std::end(box), 0);
  if (max_y < 0) return;
  const int found[] = {min_x, min_y, max_x - min_x + 1, max_y - min_y + 1};
  std::copy(std::begin(found), std::end(found), box);
}

}  // namespace pepeseg
