#include "core/features/cross_view.h"

#include <algorithm>
#include <cmath>

#include "core/features/mask_scales.h"
#include "core/features/masks_of_patch.h"

namespace pepeseg {
namespace {

constexpr double kMaxGridPixels = 65'536;  // depths kept of a view
constexpr double kDepthTolerance = 0.02;   // of the depth: what is that near is the same surface

// The finest of the masks that are not smaller; -1: none.
template <class Masks>
int32_t FinestFrom(const Masks& masks, float scale) {
  for (const auto& at : masks) {
    if (at.scale >= scale) return at.mask;
  }
  return -1;
}

}  // namespace

CrossView::CrossView(const Capture& capture, const std::vector<DrawableView>& views,
                     std::span<const std::vector<float>> depths)
    : capture_(capture), seen_(capture.views.size()) {
  for (const DrawableView& drawn : views) {
    const View& view = capture.views[drawn.view];
    Seen& seen = seen_[drawn.view];
    const int width = view.camera.width, height = view.camera.height;
    seen.stride = std::max(
        1, static_cast<int>(std::ceil(std::sqrt(double{1} * width * height / kMaxGridPixels))));
    for (int y = 0; y < height; y += seen.stride) {
      for (int x = 0; x < width; x += seen.stride) {
        seen.depth.push_back(depths[drawn.view][static_cast<size_t>(y) * width + x]);
      }
    }
    const MaskSet& masks = view.masks;
    for (int patch = 0; patch < masks.num_patches(); ++patch) {
      std::vector<MaskAt>& of_patch = seen.patch_masks.emplace_back();
      ForEachMaskIn(PatchBits(masks, patch), [&](int mask) {
        if (drawn.mask_scales[mask] > kNoScale) of_patch.push_back({mask, drawn.mask_scales[mask]});
      });
      std::stable_sort(of_patch.begin(), of_patch.end(),
                       [](const MaskAt& a, const MaskAt& b) { return a.scale < b.scale; });
    }
  }
  FindNear(views);
}

void CrossView::FindNear(const std::vector<DrawableView>& views) {
  const auto center = [&](int view) {
    return capture_.views[view].cam_from_world.Inverse().translation;
  };
  for (const DrawableView& drawn : views) {
    std::vector<std::pair<double, int>> others;
    for (const DrawableView& other : views) {
      if (other.view == drawn.view) continue;
      others.emplace_back((center(other.view) - center(drawn.view)).squaredNorm(), other.view);
    }
    const size_t count = std::min<size_t>(kNearViews, others.size());
    std::partial_sort(others.begin(), others.begin() + static_cast<std::ptrdiff_t>(count),
                      others.end());
    for (size_t i = 0; i < count; ++i) seen_[drawn.view].near.push_back(others[i].second);
  }
}

float CrossView::DepthAt(const Seen& seen, const View& view, int x, int y) {
  const int columns = (view.camera.width + seen.stride - 1) / seen.stride;
  return seen.depth[static_cast<size_t>(y / seen.stride) * columns + x / seen.stride];
}

int32_t CrossView::PatchAt(int number, const Eigen::Vector3d& point) const {
  const View& view = capture_.views[number];
  const Camera& camera = view.camera;
  const Eigen::Vector3d in_cam = view.cam_from_world * point;
  if (in_cam.z() <= 0) return kUnknown;
  const double u = camera.fx * in_cam.x() / in_cam.z() + camera.cx;
  const double v = camera.fy * in_cam.y() / in_cam.z() + camera.cy;
  if (!(u >= 0 && v >= 0 && u < camera.width && v < camera.height)) return kUnknown;
  const int x = static_cast<int>(u), y = static_cast<int>(v);
  const double depth = DepthAt(seen_[number], view, x, y);
  if (!(std::abs(depth - in_cam.z()) < kDepthTolerance * in_cam.z())) return kUnknown;
  return static_cast<int32_t>(view.masks.pixel_patch[static_cast<size_t>(y) * camera.width + x]);
}

CrossView::Sight CrossView::Look(int number, int32_t pixel) const {
  Sight sight;
  sight.fill(kUnknown);
  const View& view = capture_.views[number];
  const Camera& camera = view.camera;
  const int x = pixel % camera.width, y = pixel / camera.width;
  const double depth = DepthAt(seen_[number], view, x, y);
  if (depth <= 0) return sight;
  const Eigen::Vector3d in_cam((x + 0.5 - camera.cx) / camera.fx, (y + 0.5 - camera.cy) / camera.fy,
                               1);
  const Eigen::Vector3d point = view.cam_from_world.Inverse() * (depth * in_cam);
  const std::vector<int>& near = seen_[number].near;
  for (size_t i = 0; i < near.size(); ++i) sight[i] = PatchAt(near[i], point);
  return sight;
}

// G as ScaleLabels has it.
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
  const uint32_t all = (1u << scales.size()) - 1u;
  const std::vector<int>& near = seen_[view].near;
  for (size_t i = 0; i < near.size(); ++i) {
    if (a[i] == kUnknown || b[i] == kUnknown) continue;
    const std::vector<MaskAt>&of_a = seen_[near[i]].patch_masks[a[i]],
          &of_b = seen_[near[i]].patch_masks[b[i]];
    if (of_a.empty() && of_b.empty()) continue;
    const uint32_t agrees = Agreements(of_a, of_b, scales);
    verdict.together |= agrees;
    verdict.apart |= all & ~agrees;
  }
  return verdict;
}

}  // namespace pepeseg
