#pragma once

#include <cstdint>
#include <span>
#include <vector>

// Polygons of masks, for tools that do not read run lengths.
namespace pepeseg {

struct RasterSize {
  int width = 0, height = 0;
  bool operator==(const RasterSize&) const = default;
};

// A position in pixels: the centre of the first pixel is at (0.5, 0.5).
struct PolygonPoint {
  double x = 0, y = 0;
};

using Polygon = std::vector<PolygonPoint>;

// Returns a polygon for each part of the mask, whose pixels that are not 0 are inside. Pixels of a
// part touch by their sides; parts are in the order of their first pixels by scanlines. A slit
// without width joins a hole to its polygon.
//
// Edges are horizontal or vertical and lie a quarter of a pixel inside the mask. So a pixel is in
// the mask exactly if an odd number of polygons surround its centre. Tools that truncate the
// vertices to whole pixels and fill with the border, as OpenCV and PIL do, get the mask but for
// slits that cross a hole: 17 of 105 masks of the shelf differ by PIL, by at most 0.04 % of their
// pixels.
std::vector<Polygon> PolygonsOf(std::span<const uint8_t> mask, const RasterSize& size);

// Returns the polygons as one, joined by slits without width; empty if there are none.
Polygon Joined(const std::vector<Polygon>& polygons);

}  // namespace pepeseg
