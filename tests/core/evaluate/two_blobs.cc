#include "tests/core/evaluate/two_blobs.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/prompt/resolve_prompt.h"
#include "tests/testing/point_gaussians.h"
#include "tests/testing/status_testing.h"

namespace pepeseg::testing {

Model TwoBlobs(float gate_bias) {
  Capture capture;
  capture.points.push_back({Eigen::Vector3f(-0.6f, 0, 3), {255, 0, 0}});
  capture.points.push_back({Eigen::Vector3f(0.6f, 0, 3), {0, 0, 255}});
  Model model;
  model.gaussians = PointGaussians(capture, 0.2f);
  model.field.features.assign(2 * 32, 0.0f);
  const float half = std::sqrt(0.5f);
  model.field.features[0] = model.field.features[1] = model.field.features[32] = half;
  model.field.features[32 + 1] = -half;
  model.field.gate[1] = -20;
  model.field.gate[32 + 1] = gate_bias;
  model.field.scale_quantiles = {1, 3};
  for (const char* name : {"a", "b", "c"}) {
    ModelView view;
    view.name = name;
    view.camera = {kTwoBlobsSize, kTwoBlobsSize, 80, 80, 48, 48};
    view.cam_from_world.translation.y() = 0.1 * static_cast<double>(model.views.size());
    view.held_out = true;
    model.views.push_back(view);
  }
  return model;
}

std::vector<uint8_t> MaskOfBlob(const Segmenter& segmenter, int view, bool left) {
  const ModelView& at = segmenter.model().views[view];
  const double y = 48 + 80 * at.cam_from_world.translation.y() / 3;
  const std::vector<PointPrompt> click = {{left ? 32.5 : 64.5, y, true}};
  const auto query = ResolvePrompt(segmenter, {at, click}, {0, 0.75});
  EXPECT_OK(query);
  const auto results = segmenter.Segment(query.value_or(Query()), {&at, 1});
  EXPECT_OK(results);
  return results.ok() ? (*results)[0].mask.pixels
                      : std::vector<uint8_t>(kTwoBlobsSize * kTwoBlobsSize);
}

}  // namespace pepeseg::testing
