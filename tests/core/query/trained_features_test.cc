// Tests stage two together with queries, on a scene that is trained in seconds.
#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "core/base/status_macros.h"
#include "core/evaluate/mask_scores.h"
#include "core/query/frame.h"
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

// A line over an object, drawn through its deepest pixel, and the pixel in the middle of the line.
struct Line {
  Scribbles scribbles;
  PointPrompt middle;
};
Line LineOver(const std::vector<uint8_t>& labels, int label, const Camera& camera,
              const Eigen::Vector2d& along) {
  const PointPrompt deepest = testing::DeepestPoint(labels, label, camera.width);
  const Eigen::Vector2d through(deepest.x, deepest.y);
  const auto reach = [&](double sign) {
    double steps = 0;
    for (;; ++steps) {
      const Eigen::Vector2d at = through + sign * (steps + 1) * along;
      const int x = static_cast<int>(at.x()), y = static_cast<int>(at.y());
      if (at.x() < 0 || at.y() < 0 || x >= camera.width || y >= camera.height ||
          labels[y * camera.width + x] != label) {
        return sign * steps;
      }
    }
  };
  const double first = reach(-1), last = reach(1), inset = 0.15 * (last - first);
  const Eigen::Vector2d from = through + (first + inset) * along,
                        to = through + (last - inset) * along, middle = 0.5 * (from + to);
  ModelView view;
  view.camera = camera;
  const Stroke stroke = {{from, to}};
  return {*Frame(view).Draw({&stroke, 1}), {middle.x(), middle.y(), true}};
}

TEST(TrainedFeatures, SegmentAScribbledObjectAsWellAsOneClicked) {
  const testing::SyntheticScene scene = testing::FullyMaskedScene();
  ASSERT_OK_AND_ASSIGN(Model model, testing::TrainModel(scene));
  const auto backend = MakeCpuBackend(2);
  ASSERT_OK_AND_ASSIGN(const auto segmenter, Segmenter::Create(*backend, std::move(model)));
  double by_line = 0, by_click = 0;
  int num = 0;
  for (size_t v = 0; v < scene.capture.views.size(); ++v) {
    const ModelView& target = segmenter->model().views[v];
    for (int label = 1; label <= testing::kNumObjects; ++label) {
      std::vector<uint8_t> truth;
      for (const uint8_t at : scene.labels[v]) truth.push_back(at == label ? 1 : 0);
      if (std::count(truth.begin(), truth.end(), 1) < 60) continue;
      for (const double angle : {0.0, 0.8, 1.6, 2.4}) {
        const Line line =
            LineOver(scene.labels[v], label, target.camera, {std::cos(angle), std::sin(angle)});
        const auto iou_of = [&](const Shape& what) -> absl::StatusOr<double> {
          ASSIGN_OR_RETURN(const Query query, ResolvePrompt(*segmenter, {target, what}, {}));
          ASSIGN_OR_RETURN(const auto results, segmenter->Segment(query, {&target, 1}));
          return Iou(results[0].mask.pixels, truth);
        };
        ASSERT_OK_AND_ASSIGN(const double of_line, iou_of(line.scribbles));
        ASSERT_OK_AND_ASSIGN(const double of_click, iou_of(PointsPrompt{line.middle}));
        by_line += of_line, by_click += of_click, ++num;
        EXPECT_GT(of_line, of_click - 0.06) << target.name << ", object " << label << ", " << angle;
      }
    }
  }
  EXPECT_GE(num, 100);
  EXPECT_GT(by_line / num, 0.95);
  EXPECT_GT(by_line / num, by_click / num - 0.002);  // 0.971 and 0.972
}

}  // namespace
}  // namespace pepeseg
