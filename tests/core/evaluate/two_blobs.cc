#include "tests/core/evaluate/two_blobs.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/query/resolve_prompt.h"
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

void TwoBlobsTest::MakeModel(float gate_bias) {
  ASSERT_OK_AND_ASSIGN(segmenter_, Segmenter::Create(*backend_, TwoBlobs(gate_bias)));
}

TwoBlobsTest::Mask TwoBlobsTest::Pair(int view) const { return Union(Left(view), Right(view)); }

TwoBlobsTest::Mask TwoBlobsTest::BottomRows(int num_rows) {
  Mask mask(size_t{kTwoBlobsSize} * kTwoBlobsSize);
  std::fill(mask.end() - ptrdiff_t{num_rows} * kTwoBlobsSize, mask.end(), uint8_t{1});
  return mask;
}

TwoBlobsTest::Mask TwoBlobsTest::Union(Mask a, const Mask& b) {
  for (size_t i = 0; i < a.size(); ++i) a[i] |= b[i];
  return a;
}

double TwoBlobsTest::Area(const Mask& mask) {
  return static_cast<double>(std::count(mask.begin(), mask.end(), uint8_t{1}));
}

EvaluationRequest TwoBlobsTest::Request() const {
  EvaluationRequest request;
  for (int v = 0; v < 3; ++v) {
    TruthViewBuilder builder(segmenter_->model().views[v]);
    if (masks_.contains(v)) {
      for (const auto& [entity, mask] : masks_.at(v)) EXPECT_OK(builder.AddMask(entity, mask));
    }
    if (!ignore_.empty()) {
      EXPECT_OK(builder.AddIgnore(ignore_));
    }
    request.views.push_back(std::move(builder).Build());
  }
  request.prompts = prompts_;
  return request;
}

absl::StatusOr<EvaluationResult> TwoBlobsTest::Run() const {
  return Evaluate(*segmenter_, Request(), options_, [] { return absl::OkStatus(); });
}

}  // namespace pepeseg::testing
