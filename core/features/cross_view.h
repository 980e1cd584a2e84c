#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/features/batch_drawer.h"
#include "core/features/reprojection.h"

namespace pepeseg {

// Looks up the masks of near views at the pixels of one view.
class CrossView {
 public:
  static constexpr int kNearViews = Reprojection::kNearViews;

  // views: those that are drawn, all of them in the reprojection; both must outlive it.
  CrossView(const Reprojection& reprojection, const std::vector<DrawableView>& views);

  // The patch in which the pixel lies in each of the nearest other views; kUnknown where it is
  // hidden or outside, or where the other view is not drawn.
  static constexpr int32_t kUnknown = -1;
  using Sight = std::array<int32_t, kNearViews>;
  Sight Look(int view, int32_t pixel) const;  // view: of the capture

  // Bit k: at the scale scales[k], scene units, the masks of some near view put the two pixels
  // together (G = 1), or keep them apart (G = 0). A view of which no mask covers either says
  // nothing.
  struct Verdict {
    uint32_t together = 0, apart = 0;
  };
  Verdict Judge(int view, const Sight& a, const Sight& b, std::span<const float> scales) const;

 private:
  struct MaskAt {
    int32_t mask;
    float scale;
  };
  struct Seen {
    const MaskSet* masks = nullptr;                // null: not drawn
    std::vector<std::vector<MaskAt>> patch_masks;  // [num_patches] with a scale, ascending by it
  };

  static uint32_t Agreements(std::span<const MaskAt> a, std::span<const MaskAt> b,
                             std::span<const float> scales);

  const Reprojection& reprojection_;
  std::vector<Seen> seen_;  // by view of the capture, up to the last that is drawn
};

}  // namespace pepeseg
