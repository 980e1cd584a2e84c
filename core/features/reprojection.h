#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/scene/capture.h"

namespace pepeseg {

// Where pixels of one view lie in the views near it. The geometry is frozen, so a pixel's depth
// says where it is seen from elsewhere.
class Reprojection {
 public:
  static constexpr int kNearViews = 8;

  // views: those of the capture that take part. The capture must outlive it.
  Reprojection(const Capture& capture, std::span<const int> views);
  // Keeps a grid of a view's depth, as FrozenScene::Depth returns it. Every view that takes part
  // needs one before the first Look(). Calls for different views may run at the same time.
  void KeepDepth(int view, std::span<const float> depth);

  // By near view: the pixel there, y * width + x; kUnknown where it is hidden, outside or ignored.
  static constexpr int32_t kUnknown = -1;
  using Sight = std::array<int32_t, kNearViews>;
  Sight Look(int view, int32_t pixel) const;  // view: of the capture

  // Views that take part, by number in the capture.
  std::span<const int> views() const { return views_; }
  // At most kNearViews of them, the nearest first; none of a view that takes no part.
  std::span<const int> near(int view) const { return seen_[view].near; }
  // Pixels between two kept depths, along either axis.
  int stride(int view) const { return seen_[view].stride; }

 private:
  struct Seen {
    int stride = 1;
    std::vector<float> depth;  // [ceil(height / stride), ceil(width / stride)]
    std::vector<int> near;
    std::vector<Pose> to_near;  // from this camera's axes to those of each near view
  };

  static float DepthAt(const Seen& seen, const Camera& camera, int x, int y);
  int32_t PixelAt(int view, const Eigen::Vector3d& in_cam) const;
  void FindNear();

  const Capture& capture_;
  std::vector<int> views_;
  std::vector<Seen> seen_;  // by view of the capture; empty where it takes no part
};

}  // namespace pepeseg
