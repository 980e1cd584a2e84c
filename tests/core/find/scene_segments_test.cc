#include "core/find/scene_segments.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/testing/front_blobs.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

constexpr int kSideOfFront = 48;

absl::Status NeverGone() { return absl::OkStatus(); }

// The left blob is segment 2 of the fine level, the right one segment 1; together they are the only
// segment of the coarse level.
Decomposition TwoBlobs() {
  Decomposition::Level fine, coarse;
  fine.ids = {2, 1};
  fine.segments = {{1, 1, {0.5f, 0, 3}, {0.5f, 0, 3}}, {1, 1, {-0.5f, 0, 3}, {-0.5f, 0, 3}}};
  coarse.ids = {1, 1};
  coarse.segments = {{0, 2, {-0.5f, 0, 3}, {0.5f, 0, 3}}};
  return {{fine, coarse}};
}

class SceneSegmentsTest : public ::testing::Test {
 protected:
  void SetUp() override {
    Model model = testing::PairOfBlobs(kSideOfFront);
    for (const char* const name : {"second", "third", "fourth"}) {
      model.views.push_back(model.views[0]);
      model.views.back().name = name;
    }
    ASSERT_OK_AND_ASSIGN(model_, SceneModel::Create(*backend_, std::move(model)));
  }

  std::unique_ptr<Backend> backend_ = MakeCpuBackend(2);
  std::unique_ptr<SceneModel> model_;
};

TEST_F(SceneSegmentsTest, NumbersTheSegmentsOfAllLevels) {
  ASSERT_OK_AND_ASSIGN(const SceneSegments all, SeeSegments(*model_, TwoBlobs(), 1, NeverGone));
  ASSERT_EQ(all.segments.size(), 3u);
  for (int32_t s = 0; s < 3; ++s) EXPECT_EQ(all.NumberOf(all.segments[s].key), s);
  EXPECT_EQ(all.segments[2].key, (SegmentKey{1, 1}));
  EXPECT_EQ(all.segments[0].parent, 2);
  EXPECT_EQ(all.segments[1].parent, 2);
  EXPECT_EQ(all.segments[2].parent, -1);
  for (const SegmentKey& none : {SegmentKey{0, 0}, {0, 3}, {1, 2}, {2, 1}, {-1, 1}}) {
    EXPECT_EQ(all.NumberOf(none), -1);
  }
}

TEST_F(SceneSegmentsTest, OverlapsBySharedGaussians) {
  ASSERT_OK_AND_ASSIGN(const SceneSegments all, SeeSegments(*model_, TwoBlobs(), 1, NeverGone));
  EXPECT_EQ(all.OverlapOf(0, 0), 1);
  EXPECT_EQ(all.OverlapOf(0, 1), 0);
  EXPECT_EQ(all.OverlapOf(2, 1), 0.5);
}

TEST_F(SceneSegmentsTest, SeesEachSegmentWhereItIs) {
  ASSERT_OK_AND_ASSIGN(const SceneSegments all, SeeSegments(*model_, TwoBlobs(), 1, NeverGone));
  ASSERT_EQ(all.views.size(), 1u);
  const SeenView& seen = all.views[0];
  EXPECT_EQ(seen.width, kSideOfFront);
  const SeenArea left = seen.areas[1], right = seen.areas[0], both = seen.areas[2];
  EXPECT_GT(left.pixels, 10);
  EXPECT_LT(left.x1, right.x0);
  EXPECT_EQ(both.pixels, left.pixels + right.pixels);
  EXPECT_EQ(both.x0, left.x0);
  EXPECT_EQ(both.x1, right.x1);
  EXPECT_EQ(seen.shown[0][24 * kSideOfFront + 17], 1);
  EXPECT_EQ(seen.shown[1][24 * kSideOfFront + 17], 2);
  EXPECT_EQ(seen.shown[0][0], -1);
  EXPECT_EQ(all.SeenPixels(2), both.pixels);
}

TEST_F(SceneSegmentsTest, SpreadsViewsEvenly) {
  ASSERT_OK_AND_ASSIGN(const SceneSegments all, SeeSegments(*model_, TwoBlobs(), 2, NeverGone));
  ASSERT_EQ(all.views.size(), 2u);
  EXPECT_EQ(all.views[0].view, 0u);
  EXPECT_EQ(all.views[1].view, 2u);
}

TEST_F(SceneSegmentsTest, ShrinksLargeViews) {
  Model model = testing::PairOfBlobs(kSideOfFront);
  model.views[0].camera = {800, 400, 330, 330, 400, 200};
  ASSERT_OK_AND_ASSIGN(const auto large, SceneModel::Create(*backend_, std::move(model)));
  ASSERT_OK_AND_ASSIGN(const SceneSegments all, SeeSegments(*large, TwoBlobs(), 1, NeverGone));
  EXPECT_EQ(all.views[0].width, 283);
  EXPECT_EQ(all.views[0].height, 141);
  EXPECT_GT(all.SeenPixels(0), 0);
}

TEST_F(SceneSegmentsTest, MeasuresExtentsWithoutFloatersAndVisibleColours) {
  Model model = testing::PairOfBlobs(kSideOfFront);
  // Nine Gaussians along x, and one far away.
  const Gaussians two = model.gaussians;
  model.gaussians = two.Select(std::vector<int64_t>(10, 0));
  model.field.features.assign(10 * 32, 0.1f);
  for (int i = 0; i < 10; ++i) {
    model.gaussians.Plane(kMeanPlane)[i] = i < 9 ? 0.05f * static_cast<float>(i) : 50;
    model.gaussians.Plane(kShPlane)[i] = i < 9 ? 1 : -1;
  }
  Decomposition::Level level;
  level.ids.assign(10, 1);
  level.segments = {{0, 10, {}, {}}};
  ASSERT_OK_AND_ASSIGN(const auto line, SceneModel::Create(*backend_, std::move(model)));
  ASSERT_OK_AND_ASSIGN(const SceneSegments all, SeeSegments(*line, {{level}}, 1, NeverGone));
  const auto& segment = all.segments[0];
  EXPECT_NEAR(segment.extents[0], 0.05 * std::sqrt(60.0 / 9), 1e-4);
  EXPECT_LT(segment.extents[1], 1e-3);
  EXPECT_GT(segment.extents[2], 0);
  EXPECT_NEAR(segment.color[0], 0.5 + 0.2821, 1e-3) << "the one far away is not seen";
}

TEST_F(SceneSegmentsTest, FindsTheSegmentOfAMask) {
  ASSERT_OK_AND_ASSIGN(const SceneSegments all, SeeSegments(*model_, TwoBlobs(), 1, NeverGone));
  const SeenView& seen = all.views[0];
  std::vector<uint8_t> mask(seen.shown[0].size());
  EXPECT_EQ(SegmentLike(seen, mask, 0), -1);
  for (size_t i = 0; i < mask.size(); ++i) mask[i] = seen.shown[0][i] == 1 ? 1 : 0;
  EXPECT_EQ(SegmentLike(seen, mask, 0.5), 1);
  for (size_t i = 0; i < mask.size(); ++i) mask[i] = seen.shown[1][i] == 2 ? 1 : 0;
  EXPECT_EQ(SegmentLike(seen, mask, 0.9), 2);
  mask.assign(mask.size(), 1);
  EXPECT_EQ(SegmentLike(seen, mask, 0.5), -1);
}

TEST_F(SceneSegmentsTest, EndsWithTheErrorOfTheCheck) {
  int num_calls = 0;
  const auto check = [&] {
    return ++num_calls < 2 ? absl::OkStatus() : absl::CancelledError("gone");
  };
  EXPECT_STATUS(SeeSegments(*model_, TwoBlobs(), 4, check), absl::StatusCode::kCancelled, "gone");
}

}  // namespace
}  // namespace pepeseg
