// Tests stage two together with queries, on a scene that is trained in seconds.
#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "core/evaluate/mask_scores.h"
#include "core/query/resolve_prompt.h"
#include "core/query/segmenter.h"
#include "tests/core/query/trained_scene.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

// A click on an object in a held-out view finds that object there.
TEST(TrainedFeatures, SegmentTheClickedObjectInAHeldOutView) {
  const testing::SyntheticScene scene = testing::FullyMaskedScene();
  ASSERT_OK_AND_ASSIGN(Model model, testing::TrainModel(scene));
  const auto backend = MakeCpuBackend(2);
  ASSERT_OK_AND_ASSIGN(const auto segmenter, Segmenter::Create(*backend, std::move(model)));
  int num_scored = 0;
  for (size_t v = 0; v < scene.capture.views.size(); ++v) {
    const View& view = scene.capture.views[v];
    if (!view.held_out) continue;
    const ModelView& target = segmenter->model().views[v];
    for (int label = 1; label <= testing::kNumObjects; ++label) {
      std::vector<uint8_t> truth;
      for (const uint8_t at : scene.labels[v]) truth.push_back(at == label ? 1 : 0);
      if (std::count(truth.begin(), truth.end(), 1) < 60) continue;
      const std::vector<PointPrompt> click = {
          testing::DeepestPoint(scene.labels[v], label, view.camera.width)};
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
