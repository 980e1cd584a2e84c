#include "core/annotations/id_counts.h"

#include "core/formats/rle.h"

namespace pepeseg {

std::vector<std::string> CountsOfIds(std::span<const int32_t> ids, size_t count,
                                     const RasterSize& size) {
  struct Runs {
    std::vector<int64_t> counts;
    int64_t end = 0;  // of the last run
  };
  std::vector<Runs> masks(count);
  const int64_t num_pixels = int64_t{size.width} * size.height;
  int32_t open = 0;  // id of the run that has begun at `first`
  int64_t first = 0;
  const auto close = [&](int64_t at) {
    if (open < 1 || static_cast<size_t>(open) > count) return;
    Runs& runs = masks[static_cast<size_t>(open) - 1];
    runs.counts.insert(runs.counts.end(), {first - runs.end, at - first});
    runs.end = at;
  };
  for (int64_t x = 0, at = 0; x < size.width; ++x) {
    for (int64_t y = 0; y < size.height; ++y, ++at) {
      const int32_t id = ids[static_cast<size_t>(y * size.width + x)];
      if (id == open) continue;
      close(at);
      open = id;
      first = at;
    }
  }
  close(num_pixels);
  std::vector<std::string> encoded;
  encoded.reserve(count);
  for (Runs& runs : masks) {
    if (runs.end < num_pixels) runs.counts.push_back(num_pixels - runs.end);
    encoded.push_back(EncodeCocoCounts(runs.counts));
  }
  return encoded;
}

}  // namespace pepeseg
