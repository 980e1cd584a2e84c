#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "core/query/scene_model.h"

namespace pepeseg {

// Names a segment of a decomposition.
struct SegmentKey {
  int level = 0;   // from 0, the finest
  int32_t id = 0;  // from 1, within the level

  bool operator==(const SegmentKey&) const = default;
};

// Number and box of the pixels in which a view shows a segment, on the grid of the view.
struct SeenArea {
  int32_t pixels = 0;                        // of the grid; 0: the view does not show it
  int32_t x0 = 0, y0 = 0, x1 = -1, y1 = -1;  // first and last column and scanline
};

// The segment that each pixel of a view shows, on a grid of pixels over the view.
struct SeenView {
  size_t view = 0;            // index into Model::views
  int width = 0, height = 0;  // of the grid, at most those of the view
  // [levels][height * width] number of the segment that the pixel shows (SceneSegments); -1: none
  std::vector<std::vector<int32_t>> shown;
  std::vector<SeenArea> areas;  // [segments]
};

// The segments of all levels of a decomposition, as views of the model show them. Segments are
// numbered from 0: those of the finest level first, within a level by id.
struct SceneSegments {
  struct Segment {
    SegmentKey key;
    int32_t parent = -1;        // number of the segment that holds it; -1: on the last level
    int64_t num_gaussians = 0;  // at least 1
    std::array<float, 3> min{}, max{};  // bounding box of the Gaussians' means, scene units
    // Standard deviations of the means along their principal axes, descending, scene units, above
    // 0. Of the 90 % of the Gaussians that are nearest to the median: floaters do not count.
    std::array<float, 3> extents{};
    // Mean base colour (spherical harmonics of degree 0) of the Gaussians by how much of each the
    // views show, [0, 1]; zeros if they show none.
    std::array<float, 3> color{};
    bool is_piece = false;  // of the level of scale 0, of which a thing may be several
  };
  std::vector<Segment> segments;
  std::vector<int32_t> first;   // [levels] number of the first segment of each level
  std::vector<SeenView> views;  // in the order of the model

  // Returns the number of a segment, or -1 if there is none with this key.
  int32_t NumberOf(const SegmentKey& key) const;
  // Returns the IoU of two segments: of their Gaussians.
  double OverlapOf(int32_t a, int32_t b) const;
  // Returns the pixels of all grids that show a segment.
  int64_t SeenPixels(int32_t segment) const;
  // Returns the memory that they take, bytes.
  int64_t Bytes() const;
};

// Returns what a view of any size, such as a free camera, shows of the segments of a decomposition,
// whose numbers are those of `all`. SeenView::view stays 0. Errors are those of Segmenter::Rows.
absl::StatusOr<SeenView> SeeView(const SceneModel& model, const Decomposition& decomposition,
                                 const SceneSegments& all, const ModelView& view);

// Returns the segment whose pixels in a view have the largest IoU with a mask of its grid, [height
// * width], or -1 if none has `min_iou` or more.
int32_t SegmentLike(const SeenView& seen, std::span<const uint8_t> mask, double min_iou);

// Views that are looked at, and about the number of pixels of each grid.
inline constexpr int kMostSeenViews = 24;
inline constexpr double kSeenPixels = 40'000;

// Returns the segments of a decomposition of the model, seen in up to `max_views` views, which are
// spread evenly over those of the model. Each is rendered once, at the size of its grid. Calls
// `check` before each view and returns its error. Other errors are those of Segmenter::Rows.
absl::StatusOr<SceneSegments> SeeSegments(const SceneModel& model,
                                          const Decomposition& decomposition, int max_views,
                                          const WantedCheck& check);

}  // namespace pepeseg
