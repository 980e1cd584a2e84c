#include "core/annotations/mask_polygons.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>

namespace pepeseg {
namespace {

constexpr double kInset = 0.25;  // distance of an edge from the border of the mask, pixels

// A step along the border between pixels, with the mask on its right side.
enum Direction { kRight, kDown, kLeft, kUp };

// Follows the borders of a mask between its pixels.
class BorderTracer {
 public:
  BorderTracer(std::span<const uint8_t> mask, const RasterSize& size)
      : mask_(mask), size_(size), parts_(mask.size(), 0), traced_(mask.size(), false) {}

  // Every border, outer or of a hole, has a step to the right along the top of a pixel.
  std::vector<Polygon> Trace() {
    std::vector<Polygon> polygons;
    for (int y = 0; y < size_.height; ++y) {
      for (int x = 0; x < size_.width; ++x) {
        if (!Inside(x, y) || Inside(x, y - 1) || traced_[Index(x, y)]) continue;
        // The first border of a part that is met is its outer one.
        if (parts_[Index(x, y)] == 0) {
          polygons.push_back(Border(x, y));
          Fill(x, y, static_cast<int>(polygons.size()));
        } else {
          Polygon& outer = polygons[parts_[Index(x, y)] - 1];
          outer = Joined({std::move(outer), Border(x, y)});
        }
      }
    }
    return polygons;
  }

 private:
  size_t Index(int x, int y) const { return static_cast<size_t>(y) * size_.width + x; }
  bool Inside(int x, int y) const {
    return x >= 0 && y >= 0 && x < size_.width && y < size_.height && mask_[Index(x, y)] != 0;
  }

  // Returns the direction after a step in direction `d` that ended at the corner (x, y). Where two
  // pixels touch by a corner only, it turns right, which keeps them apart.
  Direction Next(int x, int y, Direction d) const {
    static constexpr int kAhead[4][2][2] = {// offsets of the pixels ahead: right, then left
                                            {{0, 0}, {0, -1}},
                                            {{-1, 0}, {0, 0}},
                                            {{-1, -1}, {-1, 0}},
                                            {{0, -1}, {-1, -1}}};
    const auto& [right, left] = kAhead[d];
    if (!Inside(x + right[0], y + right[1])) return static_cast<Direction>((d + 1) % 4);
    if (Inside(x + left[0], y + left[1])) return static_cast<Direction>((d + 3) % 4);
    return d;
  }

  // Returns the vertices of the border that runs along the top of the pixel (x, y).
  Polygon Border(int x, int y) {
    static constexpr int kStep[4][2] = {{1, 0}, {0, 1}, {-1, 0}, {0, -1}};
    Polygon border;
    Direction d = kRight;
    const int first_x = x, first_y = y;
    do {
      if (d == kRight) traced_[Index(x, y)] = true;
      x += kStep[d][0], y += kStep[d][1];
      const Direction next = Next(x, y, d);
      if (next != d) border.push_back(Vertex(x, y, d, next));
      d = next;
    } while (x != first_x || y != first_y || d != kRight);
    return border;
  }

  // Returns the corner (x, y) between two edges, moved into the mask.
  static PolygonPoint Vertex(int x, int y, Direction a, Direction b) {
    const auto is = [&](Direction d) { return a == d || b == d; };
    return {x + (is(kUp) ? kInset : -kInset), y + (is(kRight) ? kInset : -kInset)};
  }

  // Gives all pixels of the part that has the pixel (x, y) its number.
  void Fill(int x, int y, int part) {
    std::vector<std::pair<int, int>> open = {{x, y}};
    parts_[Index(x, y)] = part;
    while (!open.empty()) {
      const auto [px, py] = open.back();
      open.pop_back();
      for (const auto& [nx, ny] : {std::pair(px + 1, py), std::pair(px - 1, py),
                                   std::pair(px, py + 1), std::pair(px, py - 1)}) {
        if (!Inside(nx, ny) || parts_[Index(nx, ny)] != 0) continue;
        parts_[Index(nx, ny)] = part;
        open.emplace_back(nx, ny);
      }
    }
  }

  std::span<const uint8_t> mask_;
  RasterSize size_;
  std::vector<int> parts_;    // number of each pixel's part, from 1; 0: none yet
  std::vector<bool> traced_;  // the border along the pixel's top is in a polygon
};

}  // namespace

std::vector<Polygon> PolygonsOf(std::span<const uint8_t> mask, const RasterSize& size) {
  return BorderTracer(mask, size).Trace();
}

// A slit goes horizontally, then vertically, and back the same way: no edge passes a pixel's
// centre.
Polygon Joined(const std::vector<Polygon>& polygons) {
  Polygon joined;
  for (const Polygon& polygon : polygons) {
    if (joined.empty() || polygon.empty()) {
      joined.insert(joined.end(), polygon.begin(), polygon.end());
      continue;
    }
    const PolygonPoint& to = polygon.front();
    const auto distance = [&](const PolygonPoint& point) {
      return std::abs(point.x - to.x) + std::abs(point.y - to.y);
    };
    const auto from = std::min_element(
        joined.begin(), joined.end(),
        [&](const PolygonPoint& a, const PolygonPoint& b) { return distance(a) < distance(b); });
    const PolygonPoint corner{to.x, from->y};
    Polygon detour = {*from, corner};
    detour.insert(detour.end(), polygon.begin(), polygon.end());
    detour.insert(detour.end(), {to, corner});
    joined.insert(from, detour.begin(), detour.end());
  }
  return joined;
}

}  // namespace pepeseg
