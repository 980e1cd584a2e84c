#include "core/query/change_mask.h"

#include <algorithm>
#include <utility>

#include "core/query/mask_geometry.h"

namespace pepeseg {
namespace {

// The edges of a box, pixels.
struct Edges {
  double left, top, right, bottom;
  double Area() const { return std::max(0.0, right - left) * std::max(0.0, bottom - top); }
};

Edges Common(const Edges& a, const Edges& b) {
  return {std::max(a.left, b.left), std::max(a.top, b.top), std::min(a.right, b.right),
          std::min(a.bottom, b.bottom)};
}

}  // namespace

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
  const Edges view = {0, 0, static_cast<double>(result.width), static_cast<double>(result.height)};
  const Edges asked = Common({box.x, box.y, box.x + box.width, box.y + box.height}, view);
  const double left = result.box[0];
  const double top = result.box[1];
  const Edges found = {left, top, left + result.box[2], top + result.box[3]};
  const double common = Common(asked, found).Area();
  const double all = asked.Area() + found.Area() - common;
  BinaryMask cut = std::move(result.mask);
  for (size_t pixel = 0; pixel < cut.pixels.size(); ++pixel) {
    const double x = static_cast<double>(pixel % result.width) + 0.5;
    const double y = static_cast<double>(pixel / result.width) + 0.5;
    const bool kept = x > asked.left - kBoxSlack && x < asked.right + kBoxSlack &&
                      y > asked.top - kBoxSlack && y < asked.bottom + kBoxSlack;
    if (!kept) cut.pixels[pixel] = 0;
  }
  SetMask(std::move(cut), result);
  return all > 0 ? common / all : 0;
}

}  // namespace pepeseg
