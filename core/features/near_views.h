#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/features/batch_drawer.h"
#include "core/scene/capture.h"

// The views near a view: where its pixels lie in them, and what the masks there say about two
// pixels.

namespace pepeseg {

// Finds where pixels of one view lie in the views near it, by the rendered depth (METHOD.md section
// 2, "Masks that disagree"). This is exact but for the depth, because the geometry is frozen. Views
// are given by their index in the capture.
class Reprojection {
 public:
  static constexpr int kNearViews = 8;

  // views: the views that take part. The capture must outlive it.
  Reprojection(const Capture& capture, std::span<const int> views);
  // Keeps a grid of a view's depth, at most about 65,536 values. depth: [height, width] as from
  // Renderer::Depth. Must be called for each view that takes part before the first Look().
  // Calls for different views may run in parallel.
  void KeepDepth(int view, std::span<const float> depth);

  static constexpr int32_t kUnknown = -1;
  using Sight = std::array<int32_t, kNearViews>;
  // Returns where a pixel lies in each near view, in the order of near(): y * width + x there, or
  // kUnknown if it is hidden, outside or ignored there, or has no depth here. Entries beyond the
  // number of near views are kUnknown. Thread safe.
  Sight Look(int view, int32_t pixel) const;

  // Returns the views that take part.
  std::span<const int> views() const { return views_; }
  // Returns the nearest other views that take part, at most kNearViews, by the distance of the
  // cameras' centres, ascending. Empty for a view that takes no part.
  std::span<const int> near(int view) const { return seen_[view].near; }
  // Returns the distance of two kept depths along either axis, pixels.
  int stride(int view) const { return seen_[view].stride; }

 private:
  // A view that takes part.
  struct Seen {
    int stride = 1;
    std::vector<float> depth;  // [ceil(height / stride), ceil(width / stride)]
    std::vector<int> near;
    std::vector<Pose> to_near;  // from this camera's frame to that of each near view
  };

  // Returns the kept depth nearest above and to the left of (x, y).
  static float DepthAt(const Seen& seen, const Camera& camera, int x, int y);
  // Returns the pixel of `view` that shows a point in its camera frame, or kUnknown.
  int32_t PixelAt(int view, const Eigen::Vector3d& in_cam) const;
  void FindNear();

  const Capture& capture_;
  std::vector<int> views_;
  std::vector<Seen> seen_;  // by view of the capture; empty where it takes no part
};

// Judges pairs of pixels of one view by the masks of the views near it. The perception loss lets
// these masks overrule depth and colour (METHOD.md section 3, "Perception loss"). Thread safe.
class CrossView {
 public:
  static constexpr int kNearViews = Reprojection::kNearViews;

  // views: the views that are drawn, all of which take part in the reprojection. The reprojection
  // and the views' masks must outlive it.
  CrossView(const Reprojection& reprojection, const std::vector<DrawableView>& views);

  static constexpr int32_t kUnknown = -1;
  using Sight = std::array<int32_t, kNearViews>;
  // Returns the mask cell in which a pixel lies in each near view, in the order of
  // Reprojection::near. kUnknown where Reprojection::Look does not find the pixel, or where the
  // near view is not drawn. view: index in the capture.
  Sight Look(int view, int32_t pixel) const;

  // Bit k is set if at scales[k] the masks of at least one near view put two pixels together
  // (G = 1), or keep them apart (G = 0). Views may disagree, so both bits may be set.
  struct Verdict {
    uint32_t together = 0, apart = 0;
  };
  // Judges two pixels of a view by their sights. Near views in which no mask with a scale covers
  // either pixel are not asked. scales: scene units, at most kMaxScales.
  Verdict Judge(int view, const Sight& a, const Sight& b, std::span<const float> scales) const;

 private:
  // A mask over a mask cell.
  struct MaskAt {
    int32_t mask;
    float scale;  // scene units, over 0
  };
  // A view that is drawn.
  struct Seen {
    const MaskSet* masks = nullptr;                // null: the view is not drawn
    std::vector<std::vector<MaskAt>> patch_masks;  // [num_cells] masks with a scale, by scale
  };

  // Returns the scales, as bits, at which two mask cells of one view belong together.
  static uint32_t Agreements(std::span<const MaskAt> a, std::span<const MaskAt> b,
                             std::span<const float> scales);

  const Reprojection& reprojection_;
  std::vector<Seen> seen_;  // by view of the capture, up to the last that is drawn
};

}  // namespace pepeseg
