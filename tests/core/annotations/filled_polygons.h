#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "core/annotations/mask_polygons.h"

namespace pepeseg {

// Returns the pixels whose centre is in one of the polygons, 0 or 1: an odd number of the polygon's
// edges is to its left.
inline std::vector<uint8_t> Filled(const std::vector<Polygon>& polygons, const RasterSize& size) {
  std::vector<uint8_t> mask(static_cast<size_t>(size.width) * size.height, 0);
  for (const Polygon& polygon : polygons) {
    for (int y = 0; y < size.height; ++y) {
      const double at = y + 0.5;
      std::vector<double> crossings;
      for (size_t i = 0; i < polygon.size(); ++i) {
        const PolygonPoint &a = polygon[i], &b = polygon[(i + 1) % polygon.size()];
        if ((a.y <= at) == (b.y <= at)) continue;
        crossings.push_back(a.x + (b.x - a.x) * (at - a.y) / (b.y - a.y));
      }
      for (int x = 0; x < size.width; ++x) {
        const auto left = std::count_if(crossings.begin(), crossings.end(),
                                        [&](double crossing) { return crossing < x + 0.5; });
        if (left % 2 == 1) mask[static_cast<size_t>(y) * size.width + x] = 1;
      }
    }
  }
  return mask;
}

}  // namespace pepeseg
