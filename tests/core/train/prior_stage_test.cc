#include "core/train/prior_stage.h"

#include <gtest/gtest.h>

#include "tests/testing/status_testing.h"
#include "tests/testing/synthetic_capture.h"

namespace pepeseg {
namespace {

struct CancellingObserver final : TrainingObserver {
  absl::Status StartStage(Stage) override { return absl::OkStatus(); }
  absl::Status Step(const StepReport& report) override {
    EXPECT_EQ(report.num_steps, num_views);
    last_step = report.step;
    return absl::OkStatus();
  }
  absl::Status EndStage(const StageEnd&) override { return absl::OkStatus(); }
  bool IsCancelled() const override { return cancelled; }

  int64_t num_views = 0, last_step = 0;
  bool cancelled = false;
};

class PriorStageTest : public ::testing::Test {
 protected:
  PriorStageTest() {
    inputs_.tools.num_threads = 3;
    for (const View& view : scene_.capture.views) observer_.num_views += view.held_out ? 0 : 1;
  }

  TrainingScene scene_{
      .capture = testing::MakeSyntheticScene({.num_views = 5, .with_masks = false}).capture};
  TrainingInputs inputs_;
  TrainingSettings settings_;
  CancellingObserver observer_;
  StageLog stages_{observer_};
  PriorStage priors_{inputs_, settings_, stages_};
};

TEST_F(PriorStageTest, GivesTheSameWhenStartedEarly) {
  TrainingScene late = scene_;
  priors_.StartEmbedding(scene_);
  ASSERT_OK(priors_.Run(scene_));
  EXPECT_EQ(observer_.last_step, observer_.num_views);
  ASSERT_OK(PriorStage(inputs_, settings_, stages_).Run(late));
  int num_masks = 0;
  for (size_t i = 0; i < late.capture.views.size(); ++i) {
    const View &a = scene_.capture.views[i], &b = late.capture.views[i];
    EXPECT_EQ(a.masks.pixel_cell, b.masks.pixel_cell) << a.name;
    EXPECT_EQ(a.masks.cell_bits, b.masks.cell_bits) << a.name;
    EXPECT_EQ(a.depth.values.size(), b.depth.values.size()) << a.name;
    num_masks += a.masks.num_masks;
  }
  EXPECT_GT(num_masks, 0);
  EXPECT_EQ(TextOf(scene_.sources.masks), "embedded");
}

TEST_F(PriorStageTest, StartsNothingEarlyWithoutNeed) {
  settings_.priors.masks = PriorMaker::kNone;
  priors_.StartEmbedding(scene_);
  ASSERT_OK(priors_.Run(scene_));
  EXPECT_EQ(observer_.last_step, 0);
}

TEST_F(PriorStageTest, EndsWithACancelAndLeavesTheViews) {
  priors_.StartEmbedding(scene_);
  observer_.cancelled = true;
  EXPECT_TRUE(absl::IsCancelled(priors_.Run(scene_)));
  for (const View& view : scene_.capture.views) EXPECT_TRUE(view.masks.empty()) << view.name;
}

// A training may fail in stage one.
TEST_F(PriorStageTest, StopsWhenItIsDestroyed) { priors_.StartEmbedding(scene_); }

}  // namespace
}  // namespace pepeseg
