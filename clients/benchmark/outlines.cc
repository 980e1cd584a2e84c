#include "clients/benchmark/outlines.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>
#include <span>
#include <utility>

#include "absl/strings/string_view.h"
#include "absl/strings/strip.h"
#include "clients/cpp/mask.h"

namespace pepeseg::client::cli {
namespace {

// Sets the pixels of a scanline between pairs of crossings.
void FillBetween(std::vector<double>& crossings, std::span<uint8_t> scanline) {
  std::sort(crossings.begin(), crossings.end());
  // The first pixel whose centre is at or right of x.
  const auto first = [&](double x) {
    return static_cast<size_t>(
        std::clamp(std::ceil(x - 0.5), 0.0, static_cast<double>(scanline.size())));
  };
  for (size_t i = 0; i + 1 < crossings.size(); i += 2) {
    for (size_t x = first(crossings[i]); x < first(crossings[i + 1]); ++x) scanline[x] = 1;
  }
}

// Pixels of the mask per pixel of the polygons.
struct MaskScale {
  double x = 1, y = 1;
};

// Adds the pixels whose centres are inside the polygon; where it crosses itself, by even-odd.
void FillPolygon(const Polygon& polygon, const MaskScale& scale, GreyPicture& mask) {
  std::vector<std::vector<double>> crossings(static_cast<size_t>(mask.height));
  for (size_t i = 0; i < polygon.size(); ++i) {
    OutlinePoint a = polygon[i], b = polygon[(i + 1) % polygon.size()];
    if (a.y > b.y) std::swap(a, b);
    const double top = a.y * scale.y, bottom = b.y * scale.y;
    // Rows whose centres are in [top, bottom).
    const auto row = [&](double y) {
      return static_cast<int>(
          std::clamp(std::ceil(y - 0.5), 0.0, static_cast<double>(mask.height)));
    };
    for (int y = row(top); y < row(bottom); ++y) {
      const double part = (y + 0.5 - top) / (bottom - top);
      crossings[static_cast<size_t>(y)].push_back(scale.x * (a.x + part * (b.x - a.x)));
    }
  }
  for (size_t y = 0; y < crossings.size(); ++y) {
    const auto width = static_cast<size_t>(mask.width);
    FillBetween(crossings[y], std::span(mask.pixels).subspan(y * width, width));
  }
}

// Returns whether `mask` lies in `other` and touches its border nowhere: each pixel's neighbours to
// the left, right, above and below are in `other`, too. Strokes of one thing that overlap share the
// thing's border, so the smaller one is not taken for a hole.
bool IsInside(const GreyPicture& mask, const GreyPicture& other) {
  const auto is_in = [&](int x, int y) {
    return x >= 0 && y >= 0 && x < other.width && y < other.height &&
           other.pixels[static_cast<size_t>(y) * other.width + x] != 0;
  };
  for (int y = 0; y < mask.height; ++y) {
    for (int x = 0; x < mask.width; ++x) {
      if (mask.pixels[static_cast<size_t>(y) * mask.width + x] == 0) continue;
      if (!is_in(x, y) || !is_in(x - 1, y) || !is_in(x + 1, y) || !is_in(x, y - 1) ||
          !is_in(x, y + 1)) {
        return false;
      }
    }
  }
  return true;
}

// Adds the region of polygons to the mask.
void FillRegion(const std::vector<Polygon>& polygons, const MaskScale& scale, GreyPicture& mask) {
  if (polygons.size() == 1) return FillPolygon(polygons[0], scale, mask);
  std::vector<GreyPicture> masks;
  for (const Polygon& polygon : polygons) {
    GreyPicture& own = masks.emplace_back(GreyPicture{mask.width, mask.height, {}});
    own.pixels.resize(mask.pixels.size(), 0);
    FillPolygon(polygon, scale, own);
  }
  // From the outside in: how many others a polygon lies in decides whether it adds or removes.
  std::vector<std::pair<int, const GreyPicture*>> by_depth;
  for (const GreyPicture& own : masks) {
    const auto depth = std::ranges::count_if(
        masks, [&](const GreyPicture& other) { return &own != &other && IsInside(own, other); });
    by_depth.emplace_back(static_cast<int>(depth), &own);
  }
  std::ranges::stable_sort(by_depth, {}, [](const auto& entry) { return entry.first; });
  GreyPicture region{mask.width, mask.height, {}};
  region.pixels.resize(mask.pixels.size(), 0);
  for (const auto& [depth, own] : by_depth) {
    const uint8_t value = depth % 2 == 0 ? 1 : 0;
    for (size_t i = 0; i < own->pixels.size(); ++i) {
      if (own->pixels[i] != 0) region.pixels[i] = value;
    }
  }
  for (size_t i = 0; i < mask.pixels.size(); ++i) mask.pixels[i] |= region.pixels[i];
}

// Returns a name without its ending and without folders that tools add or leave out.
std::string PlainStem(std::string name) {
  std::replace(name.begin(), name.end(), '\\', '/');
  absl::string_view rest = name;
  absl::ConsumePrefix(&rest, "./");
  absl::ConsumePrefix(&rest, "images/");
  return std::filesystem::path(std::string(rest)).replace_extension().generic_string();
}

}  // namespace

Polygon BoxOf(const OutlinePoint& corner, const OutlinePoint& opposite) {
  return {corner, {opposite.x, corner.y}, opposite, {corner.x, opposite.y}};
}

Polygon CircleOf(const OutlinePoint& centre, const OutlinePoint& point) {
  constexpr int kCorners = 256;
  const double radius = std::hypot(point.x - centre.x, point.y - centre.y);
  Polygon corners;
  for (int i = 0; i < kCorners; ++i) {
    const double angle = 2 * std::numbers::pi * i / kCorners;
    corners.push_back({centre.x + radius * std::cos(angle), centre.y + radius * std::sin(angle)});
  }
  return corners;
}

const OutlinedPhotograph* OutlinesOf(const std::vector<OutlinedPhotograph>& photographs,
                                     const std::string& view) {
  const auto found = std::find_if(photographs.begin(), photographs.end(),
                                  [&](const OutlinedPhotograph& photograph) {
                                    return PlainStem(photograph.name) == PlainStem(view);
                                  });
  return found == photographs.end() ? nullptr : &*found;
}

std::vector<const OutlinedPhotograph*> PhotographsNotIn(
    const std::vector<std::string>& views, const std::vector<OutlinedPhotograph>& photographs) {
  std::set<std::string> stems;
  for (const std::string& view : views) stems.insert(PlainStem(view));
  std::vector<const OutlinedPhotograph*> others;
  for (const OutlinedPhotograph& photograph : photographs) {
    if (!stems.contains(PlainStem(photograph.name))) others.push_back(&photograph);
  }
  return others;
}

GreyPicture MaskOfEntity(const OutlinedEntity& entity, const PixelSize& drawn_on,
                         const PixelSize& size) {
  GreyPicture mask{size.width, size.height, {}};
  mask.pixels.resize(static_cast<size_t>(size.width) * size.height, 0);
  for (const OutlineRegion& region : entity.regions) {
    if (!region.rle) {
      FillRegion(region.polygons,
                 {static_cast<double>(size.width) / drawn_on.width,
                  static_cast<double>(size.height) / drawn_on.height},
                 mask);
      continue;
    }
    auto pixels = DecodeRle(*region.rle);
    if (!pixels.ok()) continue;  // ReadOutlines has checked it
    const GreyPicture drawn{region.rle->width(), region.rle->height(), std::move(*pixels)};
    const GreyPicture resized = Resized(drawn, size.width, size.height);
    for (size_t i = 0; i < mask.pixels.size(); ++i) mask.pixels[i] |= resized.pixels[i];
  }
  return mask;
}

}  // namespace pepeseg::client::cli
