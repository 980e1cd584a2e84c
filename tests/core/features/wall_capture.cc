#include "tests/core/features/wall_capture.h"

#include <numeric>

namespace pepeseg::testing {
namespace {

constexpr int kWallWidth = 80, kWallHeight = 60;
constexpr double kFocal = 40, kDistance = 2, kStep = 0.05;

Capture MakeCapture(size_t num_views) {
  Capture capture;
  for (size_t i = 0; i < num_views; ++i) {
    View& view = capture.views.emplace_back();
    view.camera = {kWallWidth, kWallHeight, kFocal, kFocal, 0.5 * kWallWidth, 0.5 * kWallHeight};
    view.cam_from_world.translation = {-kStep * static_cast<double>(i), 0, 0};
  }
  return capture;
}

std::vector<int> All(size_t count) {
  std::vector<int> all(count);
  std::iota(all.begin(), all.end(), 0);
  return all;
}

}  // namespace

WallCapture::WallCapture(const std::vector<std::vector<WallPatch>>& patches)
    : capture(MakeCapture(patches.size())), reprojection(capture, All(patches.size())) {
  for (size_t i = 0; i < patches.size(); ++i) {
    std::vector<BinaryMask> masks;
    for (const WallPatch& patch : patches[i]) masks.push_back(MaskOf(static_cast<int>(i), patch));
    capture.views[i].masks = BuildMaskSet(kWallWidth, kWallHeight, masks);
    reprojection.KeepDepth(static_cast<int>(i), std::vector<float>(kWallWidth * kWallHeight,
                                                                   static_cast<float>(kDistance)));
  }
}

BinaryMask WallCapture::MaskOf(int view, const WallPatch& patch) const {
  const Eigen::Vector3d center = capture.views[view].cam_from_world.Inverse().translation;
  BinaryMask mask;
  for (int y = 0; y < kWallHeight; ++y) {
    for (int x = 0; x < kWallWidth; ++x) {
      const double u = center.x() + (x + 0.5 - 0.5 * kWallWidth) / kFocal * kDistance;
      const double v = (y + 0.5 - 0.5 * kWallHeight) / kFocal * kDistance;
      mask.pixels.push_back(u >= patch.x0 && u < patch.x1 && v >= patch.y0 && v < patch.y1);
    }
  }
  return mask;
}

std::vector<std::vector<float>> WallCapture::EqualScales(float scale) const {
  std::vector<std::vector<float>> scales;
  for (const View& view : capture.views) scales.emplace_back(view.masks.num_masks, scale);
  return scales;
}

}  // namespace pepeseg::testing
