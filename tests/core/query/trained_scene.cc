#include "tests/core/query/trained_scene.h"

#include <utility>

#include "core/base/status_macros.h"
#include "tests/testing/run_trainers.h"

namespace pepeseg::testing {

SyntheticScene FullyMaskedScene() {
  SyntheticScene scene = MakeSyntheticScene({.num_points = 20000});
  for (size_t v = 0; v < scene.capture.views.size(); ++v) {
    View& view = scene.capture.views[v];
    std::vector<BinaryMask> masks(1 + kNumObjects);
    for (int label = 0; label <= kNumObjects; ++label) {
      masks[label].pixels.reserve(scene.labels[v].size());
      for (const uint8_t at : scene.labels[v]) masks[label].pixels.push_back(at == label ? 1 : 0);
    }
    view.masks = BuildMaskSet(view.camera.width, view.camera.height, masks);
  }
  return scene;
}

absl::StatusOr<Model> TrainModel(const SyntheticScene& scene) {
  const auto backend = MakeCpuBackend(2);
  const auto go_on = [](const StepReport&) { return absl::OkStatus(); };
  Model model;
  ASSIGN_OR_RETURN(model.gaussians,
                   testing::TrainGaussians(*backend, scene.capture, {.num_steps = 400}, go_on));
  ASSIGN_OR_RETURN(model.field,
                   testing::TrainFeatures(
                       *backend, scene.capture, model.gaussians,
                       {.num_steps = 600, .num_pixels = 200, .num_scales = 6, .seed = 2}, go_on));
  model.scene_radius = SceneRadius(scene.capture);
  for (const View& view : scene.capture.views) {
    model.views.push_back({view.name, view.camera, view.cam_from_world, view.held_out});
  }
  return model;
}

PointPrompt DeepestPoint(const std::vector<uint8_t>& labels, int label, int width) {
  const int height = static_cast<int>(labels.size()) / width;
  const auto is_inside = [&](int x, int y) {
    return x >= 0 && x < width && y >= 0 && y < height && labels[y * width + x] == label;
  };
  PointPrompt best;
  int best_depth = 0;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      int depth = is_inside(x, y)
                      ? 1
                      : 0;  // radius of the largest diamond around the pixel that lies inside
      for (bool whole = depth > 0; whole; depth += whole ? 1 : 0) {
        for (int k = 0; k <= depth && whole; ++k) {
          whole = is_inside(x + k, y + depth - k) && is_inside(x - k, y + depth - k) &&
                  is_inside(x + k, y - depth + k) && is_inside(x - k, y - depth + k);
        }
      }
      if (depth <= best_depth) continue;
      best_depth = depth;
      best = {x + 0.5, y + 0.5, true};
    }
  }
  return best;
}

}  // namespace pepeseg::testing
