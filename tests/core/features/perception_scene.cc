#include "tests/core/features/perception_scene.h"

#include "core/features/mask_scales.h"
#include "core/render/renderer.h"
#include "tests/testing/point_gaussians.h"

namespace pepeseg::testing {

PerceptionScene::PerceptionScene(SyntheticOptions options)
    : scene(MakeSyntheticScene(options)), reprojection(scene.capture, TrainedViews()) {
  const auto backend = MakeCpuBackend(2);
  gaussians = PointGaussians(scene.capture, 0.04f);
  Renderer frozen(*backend, gaussians, SceneRadius(scene.capture));
  for (size_t view = 0; view < scene.capture.views.size(); ++view) {
    const std::vector<float> depth = frozen.Depth(scene.capture.views[view]);
    mask_scales.push_back(MaskScales(scene.capture.views[view], depth));
    reprojection.KeepDepth(static_cast<int>(view), depth);
  }
  views = MakeDrawableViews(scene.capture, OwnMasks(scene.capture), mask_scales);
}

std::vector<int> PerceptionScene::TrainedViews() const {
  std::vector<int> trained;
  for (size_t view = 0; view < scene.capture.views.size(); ++view) {
    if (IsTrained(scene.capture.views[view])) trained.push_back(static_cast<int>(view));
  }
  return trained;
}

void DropMasks(Capture& capture) {
  for (size_t v = 0; v < capture.views.size(); v += 2) {
    const MaskSet& masks = capture.views[v].masks;
    std::vector<BinaryMask> kept;
    for (int mask = 1; mask < masks.num_masks; ++mask) kept.push_back(masks.Extract(mask));
    capture.views[v].masks = BuildMaskSet(masks.width, masks.height, kept);
  }
}

}  // namespace pepeseg::testing
