#include "tests/core/features/perception_scene.h"

#include "core/features/frozen_scene.h"
#include "core/features/mask_scales.h"
#include "tests/core/query/point_gaussians.h"

namespace pepeseg::testing {

PerceptionScene::PerceptionScene(SyntheticOptions options) : scene(MakeSyntheticScene(options)) {
  const auto backend = MakeCpuBackend(2);
  gaussians = PointGaussians(scene.capture, 0.04f);
  FrozenScene frozen(*backend, gaussians, SceneRadius(scene.capture));
  std::vector<std::vector<float>> mask_scales;
  for (const View& view : scene.capture.views) {
    depths.push_back(frozen.Depth(view));
    mask_scales.push_back(MaskScales(view, depths.back()));
  }
  views = MakeDrawableViews(scene.capture, mask_scales);
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
