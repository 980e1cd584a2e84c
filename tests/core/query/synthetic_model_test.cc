#include <gtest/gtest.h>

#include <algorithm>

#include "core/evaluate/metrics.h"
#include "core/features/train_features.h"
#include "core/query/resolve_prompt.h"
#include "core/query/segmenter.h"
#include "core/reconstruct/reconstruct.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/synthetic_capture.h"

namespace pepeseg {
namespace {

// The one-click protocol's prompt: the pixel deepest inside an object, by its distance to the
// nearest pixel (or border) that is not the object's.
PointPrompt Deepest(const std::vector<uint8_t>& labels, int label, int width) {
  const int height = static_cast<int>(labels.size()) / width;
  const auto is_inside = [&](int x, int y) {
    return x >= 0 && x < width && y >= 0 && y < height && labels[y * width + x] == label;
  };
  PointPrompt best;
  int best_depth = 0;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      int depth = is_inside(x, y) ? 1 : 0;  // of the largest diamond around it that is inside
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

// A mask for the table with its backdrop too, as an automatic mask generator gives one. Without it
// nothing would teach what lies beside an object.
void MaskEverything(testing::SyntheticScene& scene) {
  for (size_t v = 0; v < scene.capture.views.size(); ++v) {
    View& view = scene.capture.views[v];
    std::vector<BinaryMask> masks(1 + testing::kNumObjects);
    for (int label = 0; label <= testing::kNumObjects; ++label) {
      for (const uint8_t at : scene.labels[v]) masks[label].pixels.push_back(at == label ? 1 : 0);
    }
    view.masks = BuildMaskSet(view.camera.width, view.camera.height, masks);
  }
}

// Stage two and queries together: a click on an object in a view that was never trained on finds
// that object there.
TEST(TrainedFeatures, AClickSegmentsItsObjectInAHeldOutView) {
  testing::SyntheticScene scene = testing::MakeSyntheticScene({.num_points = 20000});
  MaskEverything(scene);
  const auto backend = MakeCpuBackend(2);
  Model model;
  const auto go_on = [](const StepReport&) { return absl::OkStatus(); };
  ASSERT_OK_AND_ASSIGN(model.gaussians,
                       Reconstruct(*backend, scene.capture, {.num_steps = 400}, go_on));
  ASSERT_OK_AND_ASSIGN(
      model.field, TrainFeatures(*backend, scene.capture, model.gaussians,
                                 {.num_steps = 600, .num_pixels = 200, .num_scales = 6}, go_on));
  model.scene_radius = SceneRadius(scene.capture);
  ASSERT_OK_AND_ASSIGN(const auto segmenter, Segmenter::Create(*backend, std::move(model)));
  int num_scored = 0;
  for (size_t v = 0; v < scene.capture.views.size(); ++v) {
    const View& view = scene.capture.views[v];
    if (!view.held_out) continue;
    const ModelView target = {view.name, view.camera, view.cam_from_world, true};
    for (int label = 1; label <= testing::kNumObjects; ++label) {
      std::vector<uint8_t> truth;
      for (const uint8_t at : scene.labels[v]) truth.push_back(at == label ? 1 : 0);
      if (std::count(truth.begin(), truth.end(), 1) < 60) continue;
      const std::vector<PointPrompt> click = {Deepest(scene.labels[v], label, view.camera.width)};
      ASSERT_OK_AND_ASSIGN(const Query query,
                           ResolvePrompt(*segmenter, {target, click}, {0.5, 0.75}));
      ASSERT_OK_AND_ASSIGN(const auto results, segmenter->Segment(query, {&target, 1}));
      const double iou = Iou(results[0].mask.pixels, truth);
      EXPECT_GT(iou, 0.8) << view.name << ", object " << label;
      ++num_scored;
    }
  }
  EXPECT_GE(num_scored, 4);
}

}  // namespace
}  // namespace pepeseg
