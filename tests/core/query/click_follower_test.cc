#include "core/query/click_follower.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <utility>
#include <vector>

#include "tests/testing/front_blobs.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

class ClickFollowerTest : public ::testing::Test {
 protected:
  static constexpr int kSize = 48;
  static constexpr double kLeftX = 17.5, kRightX = 30.5, kY = 24.5;

  void SetUp() override {
    ASSERT_OK_AND_ASSIGN(segmenter_, Segmenter::Create(*backend_, testing::PairOfBlobs(kSize)));
    view_ = segmenter_->model().views[0];
  }
  std::unique_ptr<ClickFollower> Followed(const PointsPrompt& points,
                                          const std::optional<BinaryMask>& previous = {}) const {
    auto follower = std::make_unique<ClickFollower>(*segmenter_, nullptr, view_, Granularity());
    EXPECT_OK(follower->Follow(points, previous, [] { return absl::OkStatus(); }));
    return follower;
  }
  // What the answer shows: the left blob, the right one.
  std::pair<bool, bool> Shown(const PointsPrompt& points,
                              const std::optional<BinaryMask>& previous = {}) const {
    const std::vector<uint8_t> mask = Followed(points, previous)->meaning().mask.pixels;
    const auto at = [&](double x) {
      return mask[static_cast<size_t>(kY) * kSize + static_cast<size_t>(x)] != 0;
    };
    return {at(kLeftX), at(kRightX)};
  }

  std::unique_ptr<Backend> backend_ = MakeCpuBackend(2);
  std::unique_ptr<Segmenter> segmenter_;
  ModelView view_;
};

TEST_F(ClickFollowerTest, AnswersAllPoints) {
  const PointPrompt left = {kLeftX, kY, true}, right = {kRightX, kY, true};
  const PointPrompt not_left = {kLeftX, kY, false}, not_right = {kRightX, kY, false};
  EXPECT_EQ(Shown({left, right}), std::pair(true, true));
  EXPECT_EQ(Shown({left, not_right}), std::pair(true, false));
  EXPECT_EQ(Shown({right, not_left}), std::pair(false, true));
}

TEST_F(ClickFollowerTest, KeepsTheMaskThatAnswersThePointAlready) {
  const PointPrompt left = {kLeftX, kY, true}, next_to_it = {kLeftX + 1, kY, true};
  EXPECT_EQ(Followed({left, next_to_it})->meaning().mask.pixels,
            Followed({left})->meaning().mask.pixels);
}

TEST_F(ClickFollowerTest, AnswersMorePointsThanItCorrectsOneByOne) {
  PointsPrompt points(30, {kLeftX, kY, true});
  points.push_back({kRightX, kY, false});
  EXPECT_EQ(Shown(points), std::pair(true, false));
  std::rotate(points.begin(), points.end() - 1, points.end());
  EXPECT_EQ(Shown(points), std::pair(true, false));
}

TEST_F(ClickFollowerTest, CorrectsAPreviousMaskAsItCorrectsItsOwn) {
  const PointPrompt left = {kLeftX, kY, true}, right = {kRightX, kY, true};
  const PointPrompt not_left = {kLeftX, kY, false};
  const BinaryMask before = Followed({left})->meaning().mask;
  const BinaryMask together = Followed({left, right})->meaning().mask;
  EXPECT_EQ(Followed({left, right}, before)->meaning().mask.pixels, together.pixels);
  // The mask may come from elsewhere, and no point need be positive.
  EXPECT_EQ(Shown({right}, before), std::pair(true, true));
  EXPECT_EQ(Shown({not_left}, together), std::pair(false, true));
  // Points before the last are not answered again.
  const PointPrompt not_right = {kRightX, kY, false};
  EXPECT_EQ(Shown({left, not_right, left}, together), std::pair(true, true));
  // A point that the mask answers changes nothing.
  BinaryMask half = before;
  std::fill(half.pixels.begin(), half.pixels.begin() + 20 * kSize, 0);
  const auto kept = Followed({left}, half);
  EXPECT_EQ(kept->meaning().mask.pixels, half.pixels);
  EXPECT_FALSE(kept->meaning().is_of_query);
  EXPECT_FALSE(kept->meaning().query.features.empty());
}

TEST_F(ClickFollowerTest, TakesTheFirstPositivePointFirst) {
  const PointPrompt right = {kRightX, kY, true}, not_left = {kLeftX, kY, false};
  EXPECT_EQ(Shown({not_left, right}), std::pair(false, true));
}

// A first click in the middle of both blobs means both; one on a blob means that blob. The mask of
// the meaning is that of its query.
TEST_F(ClickFollowerTest, MeansWhatHasTheClickInItsMiddle) {
  EXPECT_EQ(Shown({{kLeftX, kY, true}}), std::pair(true, false));
  const auto follower = Followed({{kLeftX, kY, true}});
  ASSERT_TRUE(follower->meaning().is_of_query);
  ASSERT_OK_AND_ASSIGN(const auto results,
                       segmenter_->Segment(follower->meaning().query, {&view_, 1}));
  EXPECT_EQ(results[0].mask.pixels, follower->meaning().mask.pixels);
  EXPECT_EQ(follower->meaning().image, BorderImage::kNone);
}

TEST_F(ClickFollowerTest, EndsWithTheErrorOfTheCheck) {
  ClickFollower follower(*segmenter_, nullptr, view_, {});
  EXPECT_TRUE(absl::IsCancelled(follower.Follow(PointsPrompt{{kLeftX, kY, true}}, {},
                                                [] { return absl::CancelledError("gone"); })));
  EXPECT_TRUE(IsNothingThere(
      ClickFollower(*segmenter_, nullptr, view_, {}).Follow(PointsPrompt{{1.5, 1.5, true}}, {}, [] {
        return absl::OkStatus();
      })));
}

}  // namespace
}  // namespace pepeseg
