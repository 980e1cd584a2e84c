#include <gtest/gtest.h>

#include <algorithm>

#include "core/evaluate/metrics.h"
#include "core/features/train_features.h"
#include "core/query/segmenter.h"
#include "tests/core/query/point_gaussians.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/synthetic_capture.h"

namespace pepeseg {
namespace {

// The middle of an object in a view: the mean of its pixels, if that pixel is its own.
PointPrompt Middle(const std::vector<uint8_t>& labels, int label, int width) {
  double x = 0, y = 0, count = 0;
  for (size_t i = 0; i < labels.size(); ++i) {
    if (labels[i] != label) continue;
    x += static_cast<double>(i % width) + 0.5;
    y += static_cast<double>(i / width) + 0.5;
    ++count;
  }
  return {x / count, y / count, true};
}

// Stage two and queries together: a click on an object in a view that was never trained on finds
// that object there.
TEST(TrainedFeatures, AClickSegmentsItsObjectInAHeldOutView) {
  const testing::SyntheticScene scene = testing::MakeSyntheticScene({.num_points = 6000});
  const auto backend = MakeCpuBackend(2);
  Model model;
  model.gaussians = testing::PointGaussians(scene.capture, 0.05f);
  ASSERT_OK_AND_ASSIGN(model.field,
                       TrainFeatures(*backend, scene.capture, model.gaussians,
                                     {.num_steps = 250, .num_pixels = 150, .num_scales = 6},
                                     [](const StepReport&) { return absl::OkStatus(); }));
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
      const PointPrompt click = Middle(scene.labels[v], label, view.camera.width);
      const auto pixel =
          static_cast<size_t>(click.y) * view.camera.width + static_cast<size_t>(click.x);
      if (scene.labels[v][pixel] != label) continue;
      const Segmenter::Prompt prompt = {target, {click}};
      ASSERT_OK_AND_ASSIGN(const auto results, segmenter->Segment(prompt, {&target, 1}));
      EXPECT_GT(Iou(results[0].mask.pixels, truth), 0.6) << view.name << ", object " << label;
      ++num_scored;
    }
  }
  EXPECT_GE(num_scored, 4);
}

}  // namespace
}  // namespace pepeseg
