#include "core/annotations/things.h"

#include <algorithm>
#include <map>
#include <set>
#include <utility>

#include "absl/strings/numbers.h"
#include "core/base/status_macros.h"
#include "core/formats/rle.h"

namespace pepeseg {

std::vector<AnnotatedThing> ThingsOf(std::span<const LabelText> labels) {
  std::vector<AnnotatedThing> things;
  std::map<std::string, std::set<int64_t>> taken;  // numbers by category
  for (const LabelText& label : labels) {
    const std::string& text = label.text.empty() ? label.id : label.text;
    AnnotatedThing thing{label.id, text, text};
    thing.track = static_cast<int64_t>(things.size()) + 1;
    const size_t dot = text.rfind('.');
    int64_t number = 0;
    if (dot != std::string::npos && dot > 0 && absl::SimpleAtoi(text.substr(dot + 1), &number) &&
        number > 0) {
      const std::string category = text.substr(0, dot);
      if (taken[category].insert(number).second) {
        thing.category = category;
        thing.instance = number;
      }
    }
    things.push_back(std::move(thing));
  }
  for (AnnotatedThing& thing : things) {
    std::set<int64_t>& numbers = taken[thing.category];
    for (int64_t number = 1; thing.instance == 0; ++number) {
      if (numbers.insert(number).second) thing.instance = number;
    }
  }
  return things;
}

std::vector<std::string> CategoriesOf(std::span<const AnnotatedThing> things) {
  std::vector<std::string> categories;
  for (const AnnotatedThing& thing : things) {
    if (std::find(categories.begin(), categories.end(), thing.category) == categories.end()) {
      categories.push_back(thing.category);
    }
  }
  return categories;
}

absl::StatusOr<BinaryMask> MaskOfCounts(absl::string_view counts, const RasterSize& size) {
  ASSIGN_OR_RETURN(const std::vector<int64_t> runs, ParseCocoCounts(counts));
  ASSIGN_OR_RETURN(const std::vector<uint32_t> pixels, PixelsOfRuns(runs, size.width, size.height));
  BinaryMask mask{std::vector<uint8_t>(static_cast<size_t>(size.width) * size.height, 0)};
  for (const uint32_t pixel : pixels) mask.pixels[pixel] = 1;
  return mask;
}

bool ShowNothing(absl::string_view counts, const RasterSize& size) {
  const int64_t all[] = {int64_t{size.width} * size.height};
  return counts == EncodeCocoCounts(all);
}

MaskExtent ExtentOf(const BinaryMask& mask, const RasterSize& size) {
  MaskExtent extent{0, size.width, size.height, 0, 0};
  int right = 0, bottom = 0;
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      if (mask.pixels[static_cast<size_t>(y) * size.width + x] == 0) continue;
      ++extent.area;
      extent.x = std::min(extent.x, x), extent.y = std::min(extent.y, y);
      right = std::max(right, x + 1), bottom = std::max(bottom, y + 1);
    }
  }
  if (extent.area == 0) return {};
  extent.width = right - extent.x, extent.height = bottom - extent.y;
  return extent;
}

}  // namespace pepeseg
