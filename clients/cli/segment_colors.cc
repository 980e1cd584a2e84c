#include "clients/cli/segment_colors.h"

#include <algorithm>
#include <cmath>
#include <map>

namespace pepeseg::client::cli {
namespace {

// Of hue in [0, 1), 6 sextants; saturation and value in [0, 1].
Rgb FromHsv(double hue, double saturation, double value) {
  const auto channel = [&](double offset) {
    const double at = std::fmod(offset + hue * 6, 6);
    const double share = std::clamp(std::min(at, 4 - at), 0.0, 1.0);
    return static_cast<uint8_t>(std::lround(255 * value * (1 - saturation * share)));
  };
  return {channel(5), channel(3), channel(1)};
}

}  // namespace

Rgb ColorOfSegment(int id) {
  if (id <= 0) return {};
  // Steps of the golden ratio never come back near a hue that was just used.
  const double hue = std::fmod(0.618033988749895 * id, 1);
  constexpr double kSaturations[] = {0.85, 0.55}, kValues[] = {1, 0.75, 0.9};
  return FromHsv(hue, kSaturations[id % 2], kValues[id % 3]);
}

Picture ColorSegments(const Grey16Picture& ids) {
  Picture picture = Picture::Filled(ids.width, ids.height, {});
  std::map<uint16_t, Rgb> colors;
  for (size_t i = 0; i < ids.pixels.size(); ++i) {
    const auto found = colors.try_emplace(ids.pixels[i], ColorOfSegment(ids.pixels[i])).first;
    picture.pixels[3 * i] = found->second.r;
    picture.pixels[3 * i + 1] = found->second.g;
    picture.pixels[3 * i + 2] = found->second.b;
  }
  return picture;
}

}  // namespace pepeseg::client::cli
