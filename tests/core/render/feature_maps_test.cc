#include "core/render/feature_maps.h"

#include <gtest/gtest.h>

#include <memory>
#include <optional>

#include "tests/testing/point_gaussians.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/synthetic_capture.h"

namespace pepeseg {
namespace {

constexpr int64_t kMapBytes = int64_t{96} * 72 * (32 * 2 + 3 * 4);

struct Maps {
  explicit Maps(int64_t max_bytes)
      : capture(testing::MakeSyntheticScene({.num_views = 4}).capture), backend(MakeCpuBackend(1)) {
    model.gaussians = testing::PointGaussians(capture, 0.1f);
    model.field.features.assign(static_cast<size_t>(model.gaussians.count) * 32, 0.1f);
    renderer.emplace(*backend, model);
    maps.emplace(*renderer, max_bytes);
  }
  ModelView View(int i) const {
    return {capture.views[i].name, capture.views[i].camera, capture.views[i].cam_from_world};
  }
  Capture capture;
  Model model;
  std::unique_ptr<Backend> backend;
  std::optional<Renderer> renderer;
  std::optional<FeatureMaps> maps;
};

TEST(FeatureMaps, RenderEachViewOnce) {
  Maps m(10 * kMapBytes);
  EXPECT_OK(m.maps->Get(m.View(0)));
  EXPECT_OK(m.maps->Get(m.View(1)));
  ModelView renamed = m.View(0);
  renamed.name = "another name, the same camera";
  EXPECT_OK(m.maps->Get(renamed));
  EXPECT_EQ(m.maps->num_renders(), 2);
  EXPECT_EQ(m.maps->bytes(), 2 * kMapBytes);
  renamed.cam_from_world.translation.x() += 0.01;
  EXPECT_OK(m.maps->Get(renamed));
  EXPECT_EQ(m.maps->num_renders(), 3);
}

TEST(FeatureMaps, DropTheLeastRecentlyUsed) {
  Maps m(2 * kMapBytes);
  for (const int view : {0, 1, 0, 2}) EXPECT_OK(m.maps->Get(m.View(view)));
  EXPECT_EQ(m.maps->num_renders(), 3);
  EXPECT_EQ(m.maps->bytes(), 2 * kMapBytes);
  EXPECT_OK(m.maps->Get(m.View(0)));  // kept: used after 1
  EXPECT_EQ(m.maps->num_renders(), 3);
  EXPECT_OK(m.maps->Get(m.View(1)));  // dropped
  EXPECT_EQ(m.maps->num_renders(), 4);
}

TEST(FeatureMaps, RefuseAMapOverTheLimitWithNeedAndLimit) {
  Maps m(kMapBytes);
  EXPECT_OK(m.maps->Get(m.View(0)));
  ModelView wide = m.View(1);
  wide.camera.width += 1;
  EXPECT_STATUS(m.maps->Get(wide), absl::StatusCode::kResourceExhausted,
                "97x72 pixels needs 530784 bytes, but the maps of a model may take 525312");
  EXPECT_EQ(m.maps->num_maps(), 1);
  EXPECT_OK(m.maps->Get(m.View(0)));  // nothing was dropped for it
  EXPECT_EQ(m.maps->num_renders(), 1);
  EXPECT_OK(m.maps->Get(m.View(1)));
  EXPECT_EQ(m.maps->bytes(), kMapBytes);
  EXPECT_EQ(m.maps->num_maps(), 1);
}

}  // namespace
}  // namespace pepeseg
