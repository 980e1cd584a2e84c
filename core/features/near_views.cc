#include "core/features/near_views.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/features/mask_scales.h"

namespace pepeseg {
namespace {

constexpr double kMaxGridPixels = 65'536;  // depths that are kept of a view, about
// Share of the depth by which a point may miss the depth of a view and still lie on its surface.
constexpr double kDepthTolerance = 0.02;

// Returns the pose that applies `inner`, then `outer`.
Pose Compose(const Pose& outer, const Pose& inner) {
  return {outer.rotation * inner.rotation, outer.rotation * inner.translation + outer.translation};
}

// Returns the finest mask that is not smaller than `scale`, or -1. masks: by scale, ascending.
template <class Masks>
int32_t FinestFrom(const Masks& masks, float scale) {
  for (const auto& at : masks) {
    if (at.scale >= scale) return at.mask;
  }
  return -1;
}

}  // namespace

Reprojection::Reprojection(const Capture& capture, std::span<const int> views)
    : capture_(capture), views_(views.begin(), views.end()), seen_(capture.views.size()) {
  FindNear();
}

void Reprojection::KeepDepth(int number, std::span<const float> depth) {
  Seen& seen = seen_[number];
  const int width = capture_.views[number].camera.width;
  const int height = capture_.views[number].camera.height;
  // Rounded up, so that the grid never exceeds kMaxGridPixels by more than its last row and column.
  seen.stride = std::max(
      1, static_cast<int>(std::ceil(std::sqrt(double{1} * width * height / kMaxGridPixels))));
  seen.depth.clear();
  for (int y = 0; y < height; y += seen.stride) {
    for (int x = 0; x < width; x += seen.stride) {
      seen.depth.push_back(depth[static_cast<size_t>(y) * width + x]);
    }
  }
}

void Reprojection::FindNear() {
  const auto center = [&](int view) -> Eigen::Vector3d {
    return capture_.views[view].cam_from_world.Inverse().translation;
  };
  for (const int view : views_) {
    std::vector<std::pair<double, int>> others;
    for (const int other : views_) {
      if (other == view) continue;
      others.emplace_back((center(other) - center(view)).squaredNorm(), other);
    }
    // Equal distances are ordered by view, so that the result is the same in each run.
    const size_t count = std::min<size_t>(kNearViews, others.size());
    std::partial_sort(others.begin(), others.begin() + static_cast<std::ptrdiff_t>(count),
                      others.end());
    Seen& seen = seen_[view];
    for (size_t i = 0; i < count; ++i) {
      const int near = others[i].second;
      seen.near.push_back(near);
      seen.to_near.push_back(Compose(capture_.views[near].cam_from_world,
                                     capture_.views[view].cam_from_world.Inverse()));
    }
  }
}

float Reprojection::DepthAt(const Seen& seen, const Camera& camera, int x, int y) {
  const int columns = (camera.width + seen.stride - 1) / seen.stride;
  return seen.depth[static_cast<size_t>(y / seen.stride) * columns + x / seen.stride];
}

int32_t Reprojection::PixelAt(int number, const Eigen::Vector3d& in_cam) const {
  const Camera& camera = capture_.views[number].camera;
  if (in_cam.z() <= 0) return kUnknown;
  const double u = camera.fx * in_cam.x() / in_cam.z() + camera.cx;
  const double v = camera.fy * in_cam.y() / in_cam.z() + camera.cy;
  // Written so that NaN is outside.
  if (!(u >= 0 && v >= 0 && u < camera.width && v < camera.height)) return kUnknown;
  // Pixel x covers [x, x + 1): truncation finds it, because centres lie at + 0.5.
  const int x = static_cast<int>(u), y = static_cast<int>(v);
  // A point in front of or behind the surface there is hidden, or the depths disagree.
  const double depth = DepthAt(seen_[number], camera, x, y);
  if (!(std::abs(depth - in_cam.z()) < kDepthTolerance * in_cam.z())) return kUnknown;
  const int32_t pixel = y * camera.width + x;
  const std::vector<uint8_t>& ignore = capture_.views[number].ignore;
  return ignore.empty() || ignore[pixel] == 0 ? pixel : kUnknown;
}

Reprojection::Sight Reprojection::Look(int number, int32_t pixel) const {
  Sight sight;
  sight.fill(kUnknown);
  const Camera& camera = capture_.views[number].camera;
  const Seen& seen = seen_[number];
  const int x = pixel % camera.width, y = pixel / camera.width;
  const double depth = DepthAt(seen, camera, x, y);
  if (depth <= 0) return sight;
  // Depth is z in the camera's frame, scene units.
  const Eigen::Vector3d in_cam = depth * Eigen::Vector3d((x + 0.5 - camera.cx) / camera.fx,
                                                         (y + 0.5 - camera.cy) / camera.fy, 1);
  for (size_t i = 0; i < seen.near.size(); ++i) {
    sight[i] = PixelAt(seen.near[i], seen.to_near[i] * in_cam);
  }
  return sight;
}

CrossView::CrossView(const Reprojection& reprojection, const std::vector<DrawableView>& views)
    : reprojection_(reprojection) {
  for (const DrawableView& drawn : views) {
    const MaskSet& masks = *drawn.masks;
    if (seen_.size() <= static_cast<size_t>(drawn.view)) seen_.resize(drawn.view + 1);
    Seen& seen = seen_[drawn.view];
    seen.masks = &masks;
    for (int cell = 0; cell < masks.num_cells(); ++cell) {
      std::vector<MaskAt>& of_patch = seen.patch_masks.emplace_back();
      ForEachMaskIn(CellBits(masks, cell), [&](int mask) {
        if (drawn.mask_scales[mask] > kNoScale) of_patch.push_back({mask, drawn.mask_scales[mask]});
      });
      // Ascending scales for FinestFrom. Stable: of masks with equal scales the first counts as the
      // finest, as in ScaleLabels.
      std::stable_sort(of_patch.begin(), of_patch.end(),
                       [](const MaskAt& a, const MaskAt& b) { return a.scale < b.scale; });
    }
  }
}

CrossView::Sight CrossView::Look(int number, int32_t pixel) const {
  Sight sight;
  sight.fill(kUnknown);
  const std::span<const int> near = reprojection_.near(number);
  const Reprojection::Sight pixels = reprojection_.Look(number, pixel);
  for (size_t i = 0; i < near.size(); ++i) {
    const auto other = static_cast<size_t>(near[i]);
    if (pixels[i] == Reprojection::kUnknown || other >= seen_.size()) continue;
    if (seen_[other].masks == nullptr) continue;
    sight[i] = static_cast<int32_t>(seen_[other].masks->pixel_cell[pixels[i]]);
  }
  return sight;
}

// Computes G without building the labels of ScaleLabels: two cells share a label if they share a
// mask below the scale, or if the finest mask from the scale on is the same.
uint32_t CrossView::Agreements(std::span<const MaskAt> a, std::span<const MaskAt> b,
                               std::span<const float> scales) {
  float finest_common = INFINITY;
  for (const MaskAt& of_a : a) {
    for (const MaskAt& of_b : b) {
      if (of_a.mask == of_b.mask) finest_common = std::min(finest_common, of_a.scale);
    }
  }
  uint32_t agrees = 0;
  for (size_t k = 0; k < scales.size(); ++k) {
    const int32_t finest = FinestFrom(a, scales[k]);
    if (finest_common < scales[k] || (finest >= 0 && finest == FinestFrom(b, scales[k]))) {
      agrees |= 1u << k;
    }
  }
  return agrees;
}

CrossView::Verdict CrossView::Judge(int view, const Sight& a, const Sight& b,
                                    std::span<const float> scales) const {
  Verdict verdict;
  // Bit k of all bitsets stands for scales[k]; kMaxScales is 16.
  const uint32_t all = (1u << scales.size()) - 1u;
  const std::span<const int> near = reprojection_.near(view);
  for (size_t i = 0; i < near.size(); ++i) {
    if (a[i] == kUnknown || b[i] == kUnknown) continue;
    const std::vector<MaskAt>&of_a = seen_[near[i]].patch_masks[a[i]],
          &of_b = seen_[near[i]].patch_masks[b[i]];
    // Where neither pixel is under a mask the view has no opinion. Where only one is, it says apart
    // at each scale. Views may contradict each other: then both bits are set.
    if (of_a.empty() && of_b.empty()) continue;
    const uint32_t agrees = Agreements(of_a, of_b, scales);
    verdict.together |= agrees;
    verdict.apart |= all & ~agrees;
  }
  return verdict;
}

}  // namespace pepeseg
