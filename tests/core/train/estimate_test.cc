#include "core/train/estimate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/priors/sam/sam_segmenter.h"

namespace pepeseg {
namespace {

using ::testing::ElementsAre;

class EstimateStagesTest : public ::testing::Test {
 protected:
  EstimateStagesTest() {
    dataset_.training.num_views = 20;
    dataset_.training.num_training_views = 17;
    dataset_.training.num_pixels = 20'000'000;
    dataset_.training.max_pixels = 1'000'000;
    dataset_.training.num_masked_views = 20;
    dataset_.max_source_pixels = 12'000'000;
    dataset_.has_poses = true;
  }

  std::vector<StageNeed> Estimate() const {
    return EstimateStages(*backend_, dataset_, settings_, tools_);
  }
  std::vector<std::string> Stages() const {
    std::vector<std::string> stages;
    for (const StageNeed& need : Estimate()) stages.push_back(need.stage);
    return stages;
  }
  StageNeed Need(const std::string& stage) const {
    for (const StageNeed& need : Estimate()) {
      if (need.stage == stage) return need;
    }
    ADD_FAILURE() << "no stage " << stage;
    return {};
  }

  const std::unique_ptr<Backend> backend_ = MakeCpuBackend(1);
  DatasetSize dataset_;
  TrainingSettings settings_;
  EstimateTools tools_;
};

TEST_F(EstimateStagesTest, ListsTheStagesThatRun) {
  EXPECT_THAT(Stages(), ElementsAre("prepare", "reconstruct", "features"));
  dataset_.has_poses = false;
  dataset_.num_given_gaussians = 1000;
  EXPECT_THAT(Stages(), ElementsAre("prepare", "sfm", "features"));
}

TEST_F(EstimateStagesTest, CountsTheTimeToReadVideos) {
  EXPECT_FALSE(Need("prepare").seconds.has_value());
  dataset_.video_megapixels = 1800 * 2.07;  // a minute at 30 frames a second, 1920x1080
  tools_.num_threads = 1;
  const std::optional<double> minute = Need("prepare").seconds;
  ASSERT_TRUE(minute.has_value());
  dataset_.video_megapixels *= 10;
  EXPECT_DOUBLE_EQ(*Need("prepare").seconds, 10 * *minute);
}

TEST_F(EstimateStagesTest, OmitsFeaturesWithoutMasks) {
  dataset_.training.num_masked_views = 0;
  settings_.priors.masks = PriorMaker::kNone;
  EXPECT_THAT(Stages(), ElementsAre("prepare", "reconstruct"));
  settings_.priors.masks = PriorMaker::kAuto;
  EXPECT_THAT(Stages(), ElementsAre("prepare", "reconstruct", "features"));
}

TEST_F(EstimateStagesTest, CountsSamInTheStagesThatItRunsNextToAndInItsOwn) {
  dataset_.training.num_masked_views = 0;
  dataset_.has_poses = false;
  const int64_t poses = Need("sfm").host_bytes, stage_one = Need("reconstruct").host_bytes;
  tools_.has_sam = true;
  EXPECT_THAT(Stages(), ElementsAre("prepare", "sfm", "reconstruct", "priors", "features"));
  EXPECT_EQ(Need("sfm").host_bytes - poses, SamHostBytes(tools_.num_threads));
  EXPECT_EQ(Need("reconstruct").host_bytes - stage_one, SamHostBytes(tools_.num_threads));
  const double on_one_core = *Need("priors").seconds;
  tools_.num_threads = 4;
  EXPECT_DOUBLE_EQ(*Need("priors").seconds, on_one_core / 4);
  tools_.has_priors_command = true;
  EXPECT_THAT(Stages(), ElementsAre("prepare", "sfm", "reconstruct", "features"));
}

TEST_F(EstimateStagesTest, NeedsMoreMemoryForMoreGaussians) {
  settings_.reconstruct.max_gaussians = 100'000;
  const StageNeed few = Need("reconstruct");
  settings_.reconstruct.max_gaussians = 1'000'000;
  const StageNeed many = Need("reconstruct");
  EXPECT_GT(few.device_bytes, 0);
  EXPECT_GT(many.device_bytes, few.device_bytes);
  EXPECT_FALSE(many.seconds.has_value());
}

}  // namespace
}  // namespace pepeseg
