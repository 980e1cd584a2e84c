#include "tests/testing/crowded_capture.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>
#include <utility>

namespace pepeseg {
namespace {

using testing::CrowdedLevel;
using testing::CrowdedScene;

CrowdedScene SmallScene(double mask_drop = 0.25) {
  return testing::MakeCrowdedScene(
      {.num_views = 9, .width = 120, .height = 90, .num_points = 500, .mask_drop = mask_drop});
}

// Returns all masks that a view could have, in order.
std::vector<BinaryMask> PossibleMasks(const CrowdedScene& scene, size_t view) {
  std::vector<BinaryMask> masks;
  for (const CrowdedLevel* level : {&scene.parts, &scene.objects}) {
    for (size_t label = 1; label < level->entities.size(); ++label) {
      BinaryMask mask;
      for (const uint16_t at : level->labels[view]) mask.pixels.push_back(at == label ? 1 : 0);
      const auto area = std::count(mask.pixels.begin(), mask.pixels.end(), 1);
      if (area >= testing::kMinMaskArea) masks.push_back(std::move(mask));
    }
  }
  return masks;
}

int NumHeldOutViews(const CrowdedScene& scene, const CrowdedLevel& level, size_t label) {
  int count = 0;
  for (size_t v = 0; v < scene.capture.views.size(); ++v) {
    if (!scene.capture.views[v].held_out) continue;
    if (std::count(level.labels[v].begin(), level.labels[v].end(), label) >= 100) ++count;
  }
  return count;
}

bool TouchesTheEdge(const std::vector<uint16_t>& labels, const Camera& camera) {
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      const bool inside = x > 0 && y > 0 && x < camera.width - 1 && y < camera.height - 1;
      if (!inside && labels[size_t(y) * camera.width + x] != 0) return true;
    }
  }
  return false;
}

TEST(CrowdedScene, ShowsEveryPartInHeldOutViewsAndWhole) {
  const CrowdedScene scene = testing::MakeCrowdedScene();
  EXPECT_EQ(scene.parts.entities.size(), 1 + 53);
  EXPECT_EQ(scene.objects.entities.size(), 1 + 3);
  for (const CrowdedLevel* level : {&scene.parts, &scene.objects}) {
    for (size_t label = 1; label < level->entities.size(); ++label) {
      EXPECT_GE(NumHeldOutViews(scene, *level, label), 2) << level->entities[label];
    }
  }
  for (size_t v = 0; v < scene.capture.views.size(); ++v) {
    EXPECT_FALSE(TouchesTheEdge(scene.parts.labels[v], scene.capture.views[v].camera)) << v;
  }
}

TEST(CrowdedScene, PartsNestInObjects) {
  const CrowdedScene scene = SmallScene();
  ASSERT_EQ(scene.object_of_part.size(), scene.parts.entities.size());
  for (size_t v = 0; v < scene.capture.views.size(); ++v) {
    for (size_t i = 0; i < scene.parts.labels[v].size(); ++i) {
      ASSERT_EQ(scene.objects.labels[v][i], scene.object_of_part[scene.parts.labels[v][i]]);
    }
  }
  EXPECT_EQ(scene.object_of_part[0], 0);
  for (size_t object = 1; object < scene.objects.entities.size(); ++object) {
    EXPECT_GE(std::count(scene.object_of_part.begin(), scene.object_of_part.end(), object), 10);
  }
}

TEST(CrowdedScene, HasMasksThatAreItsLabelsAndLacksAQuarter) {
  const CrowdedScene scene = SmallScene();
  size_t possible = 0, there = 0;
  for (size_t v = 0; v < scene.capture.views.size(); ++v) {
    const MaskSet& masks = scene.capture.views[v].masks;
    int next = 0;
    for (const BinaryMask& mask : PossibleMasks(scene, v)) {
      ++possible;
      if (next < masks.num_masks && masks.Extract(next).pixels == mask.pixels) ++next;
    }
    EXPECT_EQ(next, masks.num_masks) << v;
    there += masks.num_masks;
  }
  EXPECT_GT(possible, 300u);
  EXPECT_NEAR(static_cast<double>(there) / static_cast<double>(possible), 0.75, 0.05);
}

TEST(CrowdedScene, HasAllMasksWhenNoneIsDropped) {
  const CrowdedScene scene = SmallScene(0);
  for (size_t v = 0; v < scene.capture.views.size(); ++v) {
    EXPECT_EQ(scene.capture.views[v].masks.num_masks, PossibleMasks(scene, v).size());
  }
}

TEST(CrowdedScene, HasDisparityInEightBits) {
  for (const View& view : SmallScene().capture.views) {
    EXPECT_EQ(view.depth.kind, DepthPrior::Kind::kDisparity);
    const std::set<float> levels(view.depth.values.begin(), view.depth.values.end());
    EXPECT_EQ(*levels.begin(), 0);
    EXPECT_EQ(*levels.rbegin(), 1);
    EXPECT_GT(levels.size(), 100u);
    EXPECT_LE(levels.size(), 256u);
  }
}

TEST(CrowdedScene, IsTheSameOnEveryCall) {
  const CrowdedScene a = SmallScene(), b = SmallScene();
  EXPECT_EQ(a.parts.labels, b.parts.labels);
  for (size_t v = 0; v < a.capture.views.size(); ++v) {
    const View &x = a.capture.views[v], &y = b.capture.views[v];
    EXPECT_EQ(x.photo.pixels, y.photo.pixels);
    EXPECT_EQ(x.masks.pixel_cell, y.masks.pixel_cell);
    EXPECT_EQ(x.masks.cell_bits, y.masks.cell_bits);
    EXPECT_EQ(x.depth.values, y.depth.values);
    EXPECT_EQ(x.cam_from_world.rotation.coeffs(), y.cam_from_world.rotation.coeffs());
  }
  ASSERT_EQ(a.capture.points.size(), 500u);
  for (size_t i = 0; i < a.capture.points.size(); ++i) {
    EXPECT_EQ(a.capture.points[i].position, b.capture.points[i].position);
  }
}

}  // namespace
}  // namespace pepeseg
