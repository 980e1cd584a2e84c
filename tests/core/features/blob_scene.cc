#include "tests/core/features/blob_scene.h"

#include <cmath>
#include <string>

#include "tests/testing/point_gaussians.h"

namespace pepeseg::testing {
namespace {

constexpr double kFocal = 80, kDistance = 3, kCenter = 0.5 * kBlobViewSize;
constexpr double kViewStep = 100;  // scene units: no view shows the blobs of another
constexpr float kSize = 0.2f;      // standard deviation, scene units
constexpr double kHalfMask = 8;    // pixels

BinaryMask MaskAround(const Blob& blob) {
  BinaryMask mask;
  for (int y = 0; y < kBlobViewSize; ++y) {
    for (int x = 0; x < kBlobViewSize; ++x) {
      mask.pixels.push_back(std::abs(x + 0.5 - blob.x) < kHalfMask &&
                            std::abs(y + 0.5 - blob.y) < kHalfMask);
    }
  }
  return mask;
}

}  // namespace

BlobScene::BlobScene(const std::vector<std::vector<Blob>>& blobs_by_view) {
  for (size_t v = 0; v < blobs_by_view.size(); ++v) {
    const double left = kViewStep * static_cast<double>(v);
    View& view = capture.views.emplace_back();
    view.name = std::to_string(v);
    view.camera = {kBlobViewSize, kBlobViewSize, kFocal, kFocal, kCenter, kCenter};
    view.cam_from_world.translation.x() = -left;
    std::vector<BinaryMask> masks;
    for (const Blob& blob : blobs_by_view[v]) {
      const Eigen::Vector3d position = {left + (blob.x - kCenter) * kDistance / kFocal,
                                        (blob.y - kCenter) * kDistance / kFocal, kDistance};
      capture.points.push_back({position.cast<float>(), {255, 0, 0}});
      if (blob.is_masked) masks.push_back(MaskAround(blob));
    }
    view.masks = BuildMaskSet(kBlobViewSize, kBlobViewSize, masks);
  }
  gaussians = PointGaussians(capture, kSize);
}

}  // namespace pepeseg::testing
