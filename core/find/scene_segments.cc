#include "core/find/scene_segments.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "core/base/status_macros.h"

namespace pepeseg {
namespace {

// Lists the segments of all levels, seen nowhere yet.
SceneSegments ListSegments(const Decomposition& decomposition) {
  SceneSegments all;
  int32_t next_level = 0;
  for (size_t l = 0; l < decomposition.levels.size(); ++l) {
    const auto& segments = decomposition.levels[l].segments;
    all.first.push_back(next_level);
    next_level += static_cast<int32_t>(segments.size());
    for (size_t k = 0; k < segments.size(); ++k) {
      const Decomposition::Segment& segment = segments[k];
      all.segments.push_back({{static_cast<int>(l), static_cast<int32_t>(k + 1)},
                              segment.parent > 0 ? next_level + segment.parent - 1 : -1,
                              segment.num_gaussians,
                              segment.min,
                              segment.max});
    }
  }
  return all;
}

// Returns the view at the size of its grid.
ModelView AtGridSize(const ModelView& view) {
  const double share =
      std::min(1.0, std::sqrt(kSeenPixels / (double{1} * view.camera.width * view.camera.height)));
  const auto side = [&](int pixels) {
    return std::max(1, static_cast<int>(std::lround(pixels * share)));
  };
  return AtSize(view, side(view.camera.width), side(view.camera.height));
}

void Extend(SeenArea& area, int x, int y) {
  if (area.pixels++ == 0) area = {1, x, y, x, y};
  area.x0 = std::min(area.x0, x);
  area.x1 = std::max(area.x1, x);
  area.y1 = y;  // scanlines ascend
}

// Fills the parts of `seen` that follow from the blend rows of its grid.
void ReadRows(const PixelRows& rows, const Decomposition& decomposition, const SceneSegments& all,
              SeenView& seen) {
  seen.areas.resize(all.segments.size());
  for (size_t l = 0; l < decomposition.levels.size(); ++l) {
    std::vector<int32_t> shown = IdsOfRows(rows, decomposition.levels[l].ids);
    for (size_t i = 0; i < shown.size(); ++i) {
      shown[i] = shown[i] > 0 ? all.first[l] + shown[i] - 1 : -1;
      if (shown[i] < 0) continue;
      Extend(seen.areas[shown[i]], static_cast<int>(i) % seen.width,
             static_cast<int>(i) / seen.width);
    }
    seen.shown.push_back(std::move(shown));
  }
}

}  // namespace

int32_t SceneSegments::NumberOf(const SegmentKey& key) const {
  if (key.level < 0 || key.level >= static_cast<int>(first.size()) || key.id < 1) return -1;
  const int64_t number = int64_t{first[key.level]} + key.id - 1;
  const auto end = key.level + 1 < static_cast<int>(first.size())
                       ? static_cast<size_t>(first[key.level + 1])
                       : segments.size();
  return number < static_cast<int64_t>(end) ? static_cast<int32_t>(number) : -1;
}

double SceneSegments::OverlapOf(int32_t a, int32_t b) const {
  // Segments nest, so two that share a Gaussian are one below the other.
  const int32_t inner = std::min(a, b), outer = std::max(a, b);
  int32_t at = inner;
  while (at >= 0 && at < outer) at = segments[at].parent;
  if (at != outer) return 0;
  return static_cast<double>(segments[inner].num_gaussians) /
         static_cast<double>(segments[outer].num_gaussians);
}

int64_t SceneSegments::SeenPixels(int32_t segment) const {
  return std::accumulate(
      views.begin(), views.end(), int64_t{0},
      [&](int64_t sum, const SeenView& view) { return sum + view.areas[segment].pixels; });
}

absl::StatusOr<SceneSegments> SeeSegments(const SceneModel& model,
                                          const Decomposition& decomposition, int max_views,
                                          const WantedCheck& check) {
  SceneSegments all = ListSegments(decomposition);
  const std::vector<ModelView>& views = model.model().views;
  const size_t count = std::min(views.size(), static_cast<size_t>(std::max(0, max_views)));
  for (size_t k = 0; k < count; ++k) {
    RETURN_IF_ERROR(check());
    SeenView seen = {k * views.size() / count, 0, 0, {}, {}};
    const ModelView grid = AtGridSize(views[seen.view]);
    seen.width = grid.camera.width;
    seen.height = grid.camera.height;
    std::vector<int32_t> pixels(static_cast<size_t>(seen.width) * seen.height);
    std::iota(pixels.begin(), pixels.end(), 0);
    ASSIGN_OR_RETURN(const PixelRows rows, model.segmenter().Rows(grid, pixels));
    ReadRows(rows, decomposition, all, seen);
    all.views.push_back(std::move(seen));
  }
  return all;
}

}  // namespace pepeseg
