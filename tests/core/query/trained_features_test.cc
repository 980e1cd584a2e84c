// Tests stage two together with queries, on a scene that is trained in seconds.
#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <vector>

#include "core/base/status_macros.h"
#include "core/evaluate/mask_scores.h"
#include "core/prompt/resolve_prompt.h"
#include "core/query/border.h"
#include "core/query/segmenter.h"
#include "tests/core/query/trained_scene.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

// Returns the mask of a query in a view, with the border of the whole mask refined at once.
absl::StatusOr<std::vector<uint8_t>> RefinedInOnePiece(const Segmenter& segmenter,
                                                       const Query& query, const ModelView& view) {
  ASSIGN_OR_RETURN(const auto plain,
                   segmenter.Segment(query, {&view, 1}, {.want_similarity = true}));
  BorderPixels pixels;
  pixels.width = view.camera.width;
  pixels.height = view.camera.height;
  std::vector<int32_t> all(plain[0].mask.pixels.size());
  std::iota(all.begin(), all.end(), 0);
  ASSIGN_OR_RETURN(const std::vector<float> features, segmenter.PixelFeatures(view, all));
  for (const float value : features) pixels.features.push_back(HalfFromFloat(value));
  ASSIGN_OR_RETURN(const Image color, segmenter.RenderColor(view));
  pixels.rgb = color.pixels;
  pixels.similarity = plain[0].similarity;
  pixels.threshold = query.threshold;
  PsiAt(segmenter.model().field.gate, static_cast<float>(query.scale), pixels.psi.data());
  std::vector<uint8_t> mask = plain[0].mask.pixels;
  RefineBorder(pixels, mask);
  EXPECT_NE(mask, plain[0].mask.pixels);
  return mask;
}

// The strips in which a border is refined cannot be seen in the mask.
TEST(TrainedFeatures, HaveTheSameBordersInStripsAsInOnePiece) {
  const testing::SyntheticScene scene = testing::FullyMaskedScene();
  ASSERT_OK_AND_ASSIGN(Model model, testing::TrainModel(scene));
  const auto backend = MakeCpuBackend(2);
  ASSERT_OK_AND_ASSIGN(const auto segmenter, Segmenter::Create(*backend, std::move(model)));
  const ModelView& view = segmenter->model().views[0];
  int most_rows = 0;
  for (int label = 0; label <= testing::kNumObjects; ++label) {  // 0: what is around the objects
    const std::vector<PointPrompt> click = {
        testing::DeepestPoint(scene.labels[0], label, view.camera.width)};
    for (const double scale : {0.1, 1.0}) {
      ASSERT_OK_AND_ASSIGN(const Query query,
                           ResolvePrompt(*segmenter, {view, click}, {scale, 0.9}));
      ASSERT_OK_AND_ASSIGN(const auto want, RefinedInOnePiece(*segmenter, query, view));
      ASSERT_OK_AND_ASSIGN(const auto refined,
                           segmenter->Segment(query, {&view, 1}, {.refine_borders = true}));
      EXPECT_EQ(refined[0].mask.pixels, want);
      most_rows = std::max(most_rows, refined[0].box[3]);
    }
  }
  EXPECT_GT(most_rows, 34) << "each mask is one strip";
}

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
