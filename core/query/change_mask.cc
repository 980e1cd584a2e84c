#include "core/query/change_mask.h"

#include <algorithm>
#include <utility>

#include "core/query/mask_geometry.h"

namespace pepeseg {
void SetMask(BinaryMask mask, SegmentResult& result) {
  result.mask = std::move(mask);
  FindBox(result.mask.pixels, result.width, result.box);
  result.area = 0;
  double sum = 0;
  for (size_t pixel = 0; pixel < result.mask.pixels.size(); ++pixel) {
    if (result.mask.pixels[pixel] == 0) continue;
    ++result.area;
    sum += result.similarity[pixel];
  }
  result.score = result.area > 0 ? sum / static_cast<double>(result.area) : 0;
}

double CutToBox(const BoxPrompt& box, SegmentResult& result) {
  const BoxEdges asked = {std::max(0.0, box.x), std::max(0.0, box.y),
                          std::min<double>(result.width, box.x + box.width),
                          std::min<double>(result.height, box.y + box.height)};
  const auto [x, y, width, height] = result.box;
  const BoxEdges found = {double(x), double(y), double(x + width), double(y + height)};
  const double agreement = IouOf(asked, found);
  BinaryMask cut = std::move(result.mask);
  for (size_t pixel = 0; pixel < cut.pixels.size(); ++pixel) {
    const double column = static_cast<double>(pixel % result.width) + 0.5;
    const double row = static_cast<double>(pixel / result.width) + 0.5;
    const bool kept = column > asked.x0 - kBoxSlack && column < asked.x1 + kBoxSlack &&
                      row > asked.y0 - kBoxSlack && row < asked.y1 + kBoxSlack;
    if (!kept) cut.pixels[pixel] = 0;
  }
  SetMask(std::move(cut), result);
  return agreement;
}

}  // namespace pepeseg
