#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/features/batch_drawer.h"
#include "core/features/reprojection.h"

namespace pepeseg {

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
    std::vector<std::vector<MaskAt>> patch_masks;  // [num_patches] masks with a scale, by scale
  };

  // Returns the scales, as bits, at which two mask cells of one view belong together.
  static uint32_t Agreements(std::span<const MaskAt> a, std::span<const MaskAt> b,
                             std::span<const float> scales);

  const Reprojection& reprojection_;
  std::vector<Seen> seen_;  // by view of the capture, up to the last that is drawn
};

}  // namespace pepeseg
