#include "core/find/scene_segments.h"

#include <gtest/gtest.h>

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

TEST_F(SceneSegmentsTest, EndsWithTheErrorOfTheCheck) {
  int num_calls = 0;
  const auto check = [&] {
    return ++num_calls < 2 ? absl::OkStatus() : absl::CancelledError("gone");
  };
  EXPECT_STATUS(SeeSegments(*model_, TwoBlobs(), 4, check), absl::StatusCode::kCancelled, "gone");
}

}  // namespace
}  // namespace pepeseg
