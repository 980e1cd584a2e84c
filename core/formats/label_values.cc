#include <algorithm>
#include <cstdlib>
#include <set>

#include "core/formats/images.h"

namespace pepeseg {
namespace {

// Returns the grey value of a label, or nothing if it is a colour.
std::optional<uint32_t> GreyOf(uint32_t label) {
  if (label <= 0xffff) return label;
  const uint32_t blue = label & 0xff;
  return label == blue * 0x10101 ? std::optional(blue) : std::nullopt;
}

struct Neighbourhood {
  bool flat = true;                         // the eight neighbours have the pixel's value
  bool has_less = false, has_more = false;  // within two pixels
};

Neighbourhood Around(const LabelImage& image, int x, int y) {
  Neighbourhood around;
  const auto at = [&](int column, int row) {
    return image.labels[static_cast<size_t>(row) * image.width + column];
  };
  const uint32_t value = at(x, y);
  for (int row = std::max(0, y - 2); row <= std::min(image.height - 1, y + 2); ++row) {
    for (int column = std::max(0, x - 2); column <= std::min(image.width - 1, x + 2); ++column) {
      const uint32_t other = at(column, row);
      around.has_less = around.has_less || other < value;
      around.has_more = around.has_more || other > value;
      const bool adjacent = std::abs(row - y) <= 1 && std::abs(column - x) <= 1;
      around.flat = around.flat && (!adjacent || other == value);
    }
  }
  return around;
}

}  // namespace

// A label has an inside, where all neighbours are equal; the value of a soft border lies between
// smaller and larger ones instead.
std::optional<uint32_t> SoftMaskThreshold(const LabelImage& image) {
  constexpr double kMostFlat = 0.1, kLeastBetween = 0.8;  // of the pixels between
  constexpr size_t kFewestValues = 3;                     // between
  uint32_t most = 0;
  for (const uint32_t label : image.labels) {
    if (!GreyOf(label)) return std::nullopt;
    most = std::max(most, label);
  }
  const auto is_between = [most](uint32_t label) { return label != 0 && label != most; };
  const auto total = static_cast<double>(std::ranges::count_if(image.labels, is_between));
  const double most_flat = kMostFlat * total;
  int64_t num_flat = 0, num_between = 0;
  std::set<uint32_t> values;
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      const uint32_t label = image.labels[static_cast<size_t>(y) * image.width + x];
      if (!is_between(label)) continue;
      const Neighbourhood around = Around(image, x, y);
      if (values.size() < kFewestValues) values.insert(label);
      num_flat += around.flat;
      if (static_cast<double>(num_flat) > most_flat) return std::nullopt;
      num_between += around.has_less && around.has_more;
    }
  }
  if (values.size() < kFewestValues || static_cast<double>(num_between) < kLeastBetween * total) {
    return std::nullopt;
  }
  return most / 2;
}

bool HasVoidBorders(const LabelImage& image) {
  constexpr double kMostWide = 0.1, kLeastAtThings = 0.6;  // shares of the void pixels
  constexpr int kHalfWidth = 3, kReach = 5;                // pixels
  const uint32_t void_label = image.void_label;
  const bool is_grey = void_label <= 0xff;
  int64_t num = 0;
  bool has_other = false;
  for (const uint32_t label : image.labels) {
    if (is_grey && (label > void_label || label + 1 == void_label)) return false;
    num += label == void_label;
    has_other = has_other || (label != 0 && label != void_label);
  }
  if (num == 0 || !has_other) return false;
  const auto total = static_cast<double>(num);
  // Calls use(label) for the pixels at most `reach` away, until it returns true; returns whether it
  // did. Pixels beyond the image do not count.
  const auto any_around = [&](int x, int y, int reach, const auto& use) {
    for (int row = std::max(0, y - reach); row <= std::min(image.height - 1, y + reach); ++row) {
      for (int column = std::max(0, x - reach); column <= std::min(image.width - 1, x + reach);
           ++column) {
        if (use(image.labels[static_cast<size_t>(row) * image.width + column])) return true;
      }
    }
    return false;
  };
  int64_t num_wide = 0, num_at_things = 0;
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      if (image.labels[static_cast<size_t>(y) * image.width + x] != void_label) continue;
      num_wide +=
          !any_around(x, y, kHalfWidth, [&](uint32_t label) { return label != void_label; });
      // A wide area is soon known, and takes longest to look through.
      if (static_cast<double>(num_wide) > kMostWide * total) return false;
      num_at_things += any_around(
          x, y, kReach, [&](uint32_t label) { return label != 0 && label != void_label; });
    }
  }
  return static_cast<double>(num_at_things) >= kLeastAtThings * total;
}

LabelImage ResizedLabels(const LabelImage& image, int width, int height) {
  LabelImage resized{width, height, {}, image.void_label};
  resized.labels.reserve(static_cast<size_t>(width) * height);
  for (int64_t y = 0; y < height; ++y) {
    // The source pixel that holds the centre of the target pixel.
    const auto row = static_cast<size_t>((2 * y + 1) * image.height / (2 * int64_t{height}));
    for (int64_t x = 0; x < width; ++x) {
      const auto column = static_cast<size_t>((2 * x + 1) * image.width / (2 * int64_t{width}));
      resized.labels.push_back(image.labels[row * image.width + column]);
    }
  }
  return resized;
}

}  // namespace pepeseg
