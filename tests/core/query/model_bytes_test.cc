#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "core/query/scene_model.h"
#include "core/render/feature_maps.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

constexpr int64_t kCount = 5000;
constexpr int kDegree = 2;

// Gaussians all over what its one view shows.
Model CloudBeforeAView(int width, int height) {
  std::mt19937 engine(1);
  std::uniform_real_distribution<float> within(-1, 1);
  Model model;
  model.gaussians = Gaussians::Zero(kCount, kDegree);
  for (int64_t i = 0; i < kCount; ++i) {
    for (int k = 0; k < 3; ++k) model.gaussians.Plane(kMeanPlane + k)[i] = within(engine);
    model.gaussians.Plane(kMeanPlane + 2)[i] += 3;
    for (int k = 0; k < 3; ++k) model.gaussians.Plane(kLogScalePlane + k)[i] = std::log(0.01f);
    model.gaussians.Plane(kRotationPlane)[i] = 1;
    model.gaussians.Plane(kOpacityPlane)[i] = 1;
  }
  model.field.features.assign(kCount * kFeatureSize, 0.176f);
  model.field.confidence.assign(kCount, 1);
  ModelView view;
  view.camera = {width, height, 1.2 * width, 1.2 * width, 0.5 * width, 0.5 * height};
  model.views = {view};
  return model;
}

TEST(BytesOfModel, HoldTheModelAndAllThatQueriesLeave) {
  const auto backend = MakeCpuBackend(1);
  const Model model = CloudBeforeAView(320, 240);
  const MemoryBytes bytes = BytesOfModel(*backend, {kCount, kDegree, int64_t{320} * 240});
  ASSERT_OK_AND_ASSIGN(const auto segmenter, Segmenter::Create(*backend, model));
  const int64_t parameters = kCount * (NumPlanes(kDegree) + kFeatureSize + 1) * 4;
  EXPECT_NEAR(static_cast<double>(backend->bytes_in_use()), static_cast<double>(parameters), 1024);
  EXPECT_GT(bytes.host, parameters);
  Query query;
  query.features.assign(kFeatureSize, 0.176f);
  query.positive = {1};
  ModelView view = model.views[0];
  const auto ask = [&](int width, int height) {
    view.camera = CloudBeforeAView(width, height).views[0].camera;
    EXPECT_OK(segmenter->RenderColor(view));
    EXPECT_OK(segmenter->RenderDepth(view));
    EXPECT_OK(
        segmenter->Segment(query, {&view, 1}, {.want_similarity = true, .refine_borders = true}));
    EXPECT_LE(static_cast<int64_t>(backend->bytes_in_use()), bytes.device)
        << width << "x" << height;
  };
  ask(320, 240);
  for (int i = 0; i < 8; ++i) {  // more than the maps have room for
    view.cam_from_world.translation.x() += 0.001;
    ask(640, 480);
  }
  EXPECT_EQ(segmenter->num_maps(), 6);
  ask(1920, 1080);
  // Larger than anything is set aside for: its colours come, and what they took is given back.
  view.camera = CloudBeforeAView(3000, 2000).views[0].camera;
  EXPECT_OK(segmenter->RenderColor(view));
  EXPECT_LE(static_cast<int64_t>(backend->bytes_in_use()), bytes.device);
  EXPECT_STATUS(
      segmenter->Segment(query, {&view, 1}), absl::StatusCode::kResourceExhausted,
      "3000x2000 pixels needs 456000000 bytes, but the maps of a model may take 157593600");
  ask(320, 240);
}

TEST(BytesOfModel, GrowWithTheModelTheDegreeAndTheViews) {
  const auto backend = MakeCpuBackend(1);
  const auto device = [&](const ModelShape& shape) { return BytesOfModel(*backend, shape).device; };
  const int64_t screen = int64_t{1920} * 1080;
  EXPECT_EQ(device({1000, 0, 100}), device({1000, 0, screen / 4}));  // a screen is the least
  EXPECT_LT(device({1000, 0, screen}), device({1000, 0, 2 * screen}));
  EXPECT_EQ(device({1000, 3, 100}) - device({1000, 0, 100}),
            1000 * (NumPlanes(3) - NumPlanes(0)) * 4);
  EXPECT_LT(device({1000, 0, 100}), device({2000, 0, 100}));
  EXPECT_EQ(MapReserve(screen / 2), 2 * screen * 76);
  EXPECT_EQ(MapReserve(2 * screen), int64_t{608} << 20);
  EXPECT_EQ(MapReserve(8 * screen), 8 * screen * 76);
}

}  // namespace
}  // namespace pepeseg
