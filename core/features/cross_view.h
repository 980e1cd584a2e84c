#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/features/batch_drawer.h"
#include "core/scene/capture.h"

namespace pepeseg {

// What the masks of other views say of pixels of one view. The geometry is frozen, so where a pixel
// is seen from elsewhere is known.
class CrossView {
 public:
  static constexpr int kNearViews = 8;

  // depths: of each view of the capture that is drawn, as FrozenScene::Depth gives them. Capture
  // and views must outlive it.
  CrossView(const Capture& capture, const std::vector<DrawableView>& views,
            std::span<const std::vector<float>> depths);

  // The patch in which the pixel lies in each of the nearest other views; kUnknown where it is
  // hidden or outside.
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
    int stride = 1;            // of the depths that are kept
    std::vector<float> depth;  // [ceil(height / stride), ceil(width / stride)]
    std::vector<int> near;     // views of the capture, the nearest first; at most kNearViews
    std::vector<std::vector<MaskAt>> patch_masks;  // [num_patches] with a scale, ascending by it
  };

  static float DepthAt(const Seen& seen, const View& view, int x, int y);
  int32_t PatchAt(int view, const Eigen::Vector3d& point) const;
  void FindNear(const std::vector<DrawableView>& views);
  static uint32_t Agreements(std::span<const MaskAt> a, std::span<const MaskAt> b,
                             std::span<const float> scales);

  const Capture& capture_;
  std::vector<Seen> seen_;  // by view of the capture; empty where it is not drawn
};

}  // namespace pepeseg
