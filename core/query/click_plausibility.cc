#include "core/query/click_plausibility.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace pepeseg {
namespace {

constexpr double kMiddleExponent = 1.5;  // of the relative depth of a first click
constexpr double kUnanswered = 0.7;      // for each click that a mask does not answer
constexpr double kNearReach = 1.5;

size_t IndexOf(const PixelIndex& pixel, int width) {
  return static_cast<size_t>(pixel.y) * width + pixel.x;
}

// Returns the squared distance of a pixel to the nearest pixel outside the mask. Everything beyond
// the image is outside.
int64_t SquaredDepth(std::span<const uint8_t> mask, int width, const PixelIndex& at) {
  const int height = static_cast<int>(mask.size()) / width;
  const int64_t border = std::min({at.x + 1, width - at.x, at.y + 1, height - at.y});
  int64_t nearest = border * border;
  for (int y = 0; y < height; ++y) {
    const int64_t dy = y - at.y;
    if (dy * dy >= nearest) continue;
    const auto reach = static_cast<int>(std::sqrt(nearest - dy * dy)) + 1;
    for (int x = std::max(0, at.x - reach); x < std::min(width, at.x + reach + 1); ++x) {
      const int64_t dx = x - at.x;
      if (mask[static_cast<size_t>(y) * width + x] == 0) {
        nearest = std::min(nearest, dx * dx + dy * dy);
      }
    }
  }
  return nearest;
}

// Returns the depth of a pixel of a mask as a share of the greatest depth in it.
double RelativeDepth(const PixelIndex& pixel, std::span<const uint8_t> mask, int width) {
  const int height = static_cast<int>(mask.size()) / width;
  const auto deepest = static_cast<double>(FindDeepest(mask, width, height).squared_depth);
  return std::sqrt(static_cast<double>(SquaredDepth(mask, width, pixel)) / deepest);
}

// Returns the pixels that change as the click asks.
std::vector<uint8_t> Asked(const PixelClick& click, std::span<const uint8_t> before,
                           std::span<const uint8_t> after) {
  std::vector<uint8_t> asked(after.size());
  for (size_t i = 0; i < after.size(); ++i) {
    const bool was = before[i] != 0, is = after[i] != 0;
    asked[i] = (click.positive ? is && !was : was && !is) ? 1 : 0;
  }
  return asked;
}

// Returns the pixels of a mask that are connected with one of them by edges.
std::vector<uint8_t> Connected(std::span<const uint8_t> mask, const PixelIndex& pixel, int width) {
  std::vector<uint8_t> connected(mask.size());
  std::vector<size_t> open = {IndexOf(pixel, width)};
  connected[open[0]] = 1;
  const auto add = [&](size_t i) {
    if (mask[i] == 0 || connected[i] != 0) return;
    connected[i] = 1;
    open.push_back(i);
  };
  while (!open.empty()) {
    const size_t i = open.back(), x = i % width;
    open.pop_back();
    if (x > 0) add(i - 1);
    if (x + 1 < static_cast<size_t>(width)) add(i + 1);
    if (i >= static_cast<size_t>(width)) add(i - width);
    if (i + width < mask.size()) add(i + width);
  }
  return connected;
}

}  // namespace

int64_t NumAnswered(std::span<const PixelClick> clicks, std::span<const uint8_t> mask, int width) {
  return std::count_if(clicks.begin(), clicks.end(), [&](const PixelClick& click) {
    return (mask[IndexOf(click.pixel, width)] != 0) == click.positive;
  });
}

double FirstClickPlausibility(const PixelIndex& pixel, std::span<const uint8_t> mask, int width) {
  if (mask[IndexOf(pixel, width)] == 0) return 0;
  return std::pow(RelativeDepth(pixel, mask, width), kMiddleExponent);
}

double ClickPlausibility(std::span<const PixelClick> clicks, std::span<const uint8_t> before,
                         std::span<const uint8_t> after, int width) {
  const PixelClick& click = clicks.back();
  const std::vector<uint8_t> asked = Asked(click, before, after);
  if (asked[IndexOf(click.pixel, width)] == 0) return 0;
  const std::vector<uint8_t> connected = Connected(asked, click.pixel, width);
  int32_t area_before = 0, area_after = 0, common = 0, local = 0;
  for (size_t i = 0; i < after.size(); ++i) {
    area_before += before[i];
    area_after += after[i];
    common += before[i] & after[i];
    local += connected[i];
  }
  const double changed = area_before + area_after - 2.0 * common;
  const double kept = 1.0 * common / std::max(1, click.positive ? area_before : area_after);
  const auto num_unanswered =
      static_cast<double>(clicks.size()) - static_cast<double>(NumAnswered(clicks, after, width));
  return RelativeDepth(click.pixel, asked, width) * std::cbrt(kept * local / changed) *
         std::pow(kUnanswered, num_unanswered);
}

std::vector<uint8_t> ChangeMask(const PixelClick& click, std::span<const uint8_t> before,
                                std::span<const uint8_t> after, int width, ChangeReach reach) {
  const std::vector<uint8_t> asked = Asked(click, before, after);
  if (asked[IndexOf(click.pixel, width)] == 0) return {};
  if (reach == ChangeReach::kWhole) return {after.begin(), after.end()};
  std::vector<uint8_t> changed = Connected(asked, click.pixel, width);
  if (reach == ChangeReach::kNear) {
    const double squared_reach =
        kNearReach * kNearReach * static_cast<double>(SquaredDepth(asked, width, click.pixel));
    size_t i = 0;
    for (int64_t dy = -click.pixel.y; i < changed.size(); ++dy) {
      for (int64_t x = 0; x < width; ++x, ++i) {
        const int64_t dx = x - click.pixel.x;
        if (static_cast<double>(dx * dx + dy * dy) > squared_reach) changed[i] = 0;
      }
    }
  }
  for (size_t i = 0; i < changed.size(); ++i) changed[i] ^= before[i];
  return changed;
}

}  // namespace pepeseg
