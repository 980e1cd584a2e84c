#include "core/features/near_views.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/core/features/perception_scene.h"

namespace pepeseg {
namespace {

using ::pepeseg::testing::kBlueBox;
using ::pepeseg::testing::kRedBox;

// Returns the pixels of a view whose 5x5 neighbourhood shows one object only. label 0: the table.
std::vector<int32_t> Inside(const testing::PerceptionScene& scene, int view, int label) {
  const Camera& camera = scene.scene.capture.views[view].camera;
  const std::vector<uint8_t>& labels = scene.scene.labels[view];
  std::vector<int32_t> pixels;
  for (int y = 2; y < camera.height - 2; ++y) {
    for (int x = 2; x < camera.width - 2; ++x) {
      bool inside = true;
      for (int v = -2; v <= 2; ++v) {
        for (int u = -2; u <= 2; ++u) inside &= labels[(y + v) * camera.width + x + u] == label;
      }
      if (inside) pixels.push_back(y * camera.width + x);
    }
  }
  return pixels;
}

class CrossViewTest : public ::testing::Test {
 protected:
  testing::PerceptionScene scene_;
  CrossView cross_view_ = CrossView(scene_.reprojection, scene_.views);
  int view_ = scene_.views[3].view;
};

TEST_F(CrossViewTest, FindsMostOfAnObjectUnderMasksOfOtherViews) {
  const std::vector<int32_t> pixels = Inside(scene_, view_, kRedBox);
  ASSERT_GT(pixels.size(), 20u);
  int num_known = 0;
  for (const int32_t pixel : pixels) {
    const CrossView::Sight sight = cross_view_.Look(view_, pixel);
    num_known += std::ranges::any_of(sight, [](int32_t cell) { return cell > 0; });
  }
  EXPECT_GT(num_known, 0.9 * static_cast<double>(pixels.size()));
}

TEST_F(CrossViewTest, JudgesOneObjectTogetherAndTwoObjectsApart) {
  const std::vector<int32_t> red = Inside(scene_, view_, kRedBox),
                             blue = Inside(scene_, view_, kBlueBox);
  ASSERT_GT(blue.size(), 20u);
  const std::vector<float> scales = {0.01f, 0.3f, 10};
  int num_judged = 0, num_wrong = 0;
  for (size_t i = 0; i < std::min(red.size(), blue.size()); i += 5) {
    const CrossView::Sight a = cross_view_.Look(view_, red[i]),
                           b = cross_view_.Look(view_, red[red.size() - 1 - i]),
                           c = cross_view_.Look(view_, blue[i]);
    const CrossView::Verdict same = cross_view_.Judge(view_, a, b, scales),
                             other = cross_view_.Judge(view_, a, c, scales);
    EXPECT_TRUE(same.together == 7 || same.together == 0);
    // Splats overhang the masks, so that a pixel may miss the mask of another view.
    num_wrong += same.apart != 0 ? 1 : 0;
    EXPECT_EQ(other.together, 0u);
    EXPECT_TRUE(other.apart == 7 || other.apart == 0);
    num_judged += same.together != 0 && other.apart != 0 ? 1 : 0;
  }
  EXPECT_GE(num_judged, 3);
  EXPECT_LE(num_wrong, 2);
}

TEST_F(CrossViewTest, KeepsAnObjectApartFromUncoveredPixelsAndIsSilentAmongThose) {
  const std::vector<int32_t> red = Inside(scene_, view_, kRedBox), table = Inside(scene_, view_, 0);
  const std::vector<float> scales = {0.01f, 10};
  int num_judged = 0;
  for (size_t i = 0; i < red.size(); i += 5) {
    const CrossView::Sight a = cross_view_.Look(view_, table[i]),
                           b = cross_view_.Look(view_, table[i + 1]),
                           c = cross_view_.Look(view_, red[i]);
    const CrossView::Verdict of_table = cross_view_.Judge(view_, a, b, scales),
                             other = cross_view_.Judge(view_, a, c, scales);
    EXPECT_EQ(of_table.together | of_table.apart, 0u);
    EXPECT_EQ(other.together, 0u);
    num_judged += other.apart == 3 ? 1 : 0;
  }
  EXPECT_GE(num_judged, 3);
}

TEST_F(CrossViewTest, KnowsNothingWithoutOtherViews) {
  scene_.views.resize(1);
  const CrossView alone(scene_.reprojection, scene_.views);
  const CrossView::Sight sight = alone.Look(scene_.views[0].view, scene_.views[0].pixels[0]);
  for (const int32_t cell : sight) EXPECT_EQ(cell, CrossView::kUnknown);
}

}  // namespace
}  // namespace pepeseg
