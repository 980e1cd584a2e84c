#include "core/evaluate/sam_agreement.h"

#include <gtest/gtest.h>

#include "tests/core/evaluate/two_blobs.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

using testing::kTwoBlobsSize;

absl::Status Proceed() { return absl::OkStatus(); }

class SamAgreementTest : public ::testing::Test {
 protected:
  void SetUp() override {
    ASSERT_OK_AND_ASSIGN(segmenter_, Segmenter::Create(*backend_, testing::TwoBlobs()));
    left_ = testing::MaskOfBlob(*segmenter_, 0, true);
    both_ = testing::MaskOfBlob(*segmenter_, 0, false);
    for (size_t i = 0; i < both_.size(); ++i) both_[i] |= left_[i];
    rows_.assign(left_.size(), 0);
    std::fill(rows_.end() - ptrdiff_t{2} * kTwoBlobsSize, rows_.end(), 1);
  }

  SamView View(const std::vector<std::vector<uint8_t>>& masks) const {
    std::vector<BinaryMask> binary;
    for (const auto& mask : masks) binary.push_back({mask});
    SamView sam;
    sam.view = segmenter_->model().views[0];
    sam.masks = BuildMaskSet(kTwoBlobsSize, kTwoBlobsSize, binary, /*duplicate_iou=*/1);
    return sam;
  }
  absl::StatusOr<SamAgreement> Score(const SamView& sam) const {
    return ScoreSamAgreement(*segmenter_, {&sam, 1}, options_, {}, Proceed);
  }

  std::unique_ptr<Backend> backend_ = MakeCpuBackend(2);
  std::unique_ptr<Segmenter> segmenter_;
  std::vector<uint8_t> left_, both_, rows_;  // rows_: nothing is rendered there
  SamAgreementOptions options_;
};

TEST_F(SamAgreementTest, TakesTheBestOfThreeProposals) {
  ASSERT_OK_AND_ASSIGN(const SamAgreement agreement, Score(View({left_, both_, rows_})));
  EXPECT_EQ(agreement.num_masks, 3);
  ASSERT_EQ(agreement.views.size(), 1u);
  const std::vector<SamMaskScore>& masks = agreement.views[0].masks;
  ASSERT_EQ(masks.size(), 3u);
  EXPECT_NEAR(masks[0].click.x, 32.5, 1);
  EXPECT_DOUBLE_EQ(masks[0].first_iou, 1);  // apart at more scales than together
  EXPECT_DOUBLE_EQ(masks[0].best_iou, 1);
  EXPECT_NEAR(masks[1].first_iou, 0.5, 0.02);
  EXPECT_DOUBLE_EQ(masks[1].best_iou, 1);
  EXPECT_EQ(masks[2].num_pixels, 2 * kTwoBlobsSize);
  EXPECT_EQ(masks[2].best_iou, 0);
  EXPECT_DOUBLE_EQ(agreement.best_iou, 2.0 / 3);
  EXPECT_DOUBLE_EQ(agreement.views[0].best_iou, 2.0 / 3);
  EXPECT_NEAR(agreement.first_iou, 0.5, 0.02);

  options_.num_proposals = 1;
  ASSERT_OK_AND_ASSIGN(const SamAgreement first, Score(View({left_, both_, rows_})));
  EXPECT_DOUBLE_EQ(first.best_iou, first.first_iou);
  EXPECT_DOUBLE_EQ(first.best_iou, agreement.first_iou);
}

TEST_F(SamAgreementTest, CountsMasksThatSamIsSureOf) {
  SamView sam = View({left_, both_, rows_});
  sam.predicted_iou = {0.88, 0.879, 0.9};
  sam.stability = {0.92, 0.99, 0.919};
  ASSERT_OK_AND_ASSIGN(SamAgreement agreement, Score(sam));
  ASSERT_EQ(agreement.num_masks, 1);
  EXPECT_EQ(agreement.views[0].masks[0].mask, 0);
  EXPECT_DOUBLE_EQ(agreement.best_iou, 1);
  sam.ignore.assign(left_.size(), 0);
  for (int i = 0; i < kTwoBlobsSize * kTwoBlobsSize; ++i)
    sam.ignore[i] = i % kTwoBlobsSize < 32 ? 1 : 0;
  EXPECT_STATUS(Score(sam), absl::StatusCode::kInvalidArgument,
                "none of the masks of 1 views counts: a mask needs a predicted IoU of 0.88, a "
                "stability of 0.92 and 100 pixels");  // half of the blob is left
  options_.min_pixels = 40;
  ASSERT_OK_AND_ASSIGN(agreement, Score(sam));
  EXPECT_GT(agreement.views[0].masks[0].click.x, 32);
  EXPECT_DOUBLE_EQ(agreement.best_iou, 1);
}

TEST_F(SamAgreementTest, RefusesViewsAndOptionsThatDoNotFit) {
  SamView sam = View({left_});
  sam.stability = {1, 1};
  EXPECT_STATUS(Score(sam), absl::StatusCode::kInvalidArgument,
                "view \"a\": 1 masks of 9216 pixels with 0 predicted IoUs, 2 stability scores");
  sam.stability.clear();
  options_.min_predicted_iou = 2;
  EXPECT_STATUS(Score(sam), absl::StatusCode::kInvalidArgument,
                "sam_agreement.min_predicted_iou is 2, must be in [0, 1]");
}

TEST_F(SamAgreementTest, ReturnsTheErrorOfCheckCancelled) {
  const SamView sam = View({left_, both_});
  for (const int allowed : {0, 1}) {
    int asked = 0;
    const auto agreement = ScoreSamAgreement(*segmenter_, {&sam, 1}, options_, {}, [&] {
      return asked++ < allowed ? absl::OkStatus() : absl::CancelledError("enough");
    });
    EXPECT_STATUS(agreement, absl::StatusCode::kCancelled, "enough");
    EXPECT_EQ(asked, allowed + 1);
  }
}

}  // namespace
}  // namespace pepeseg
