#include "core/train/settings/estimate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
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
    for (const StageNeed& need : Estimate()) stages.emplace_back(NameOf(need.stage));
    return stages;
  }
  StageNeed Need(Stage stage) const {
    for (const StageNeed& need : Estimate()) {
      if (need.stage == stage) return need;
    }
    ADD_FAILURE() << "no stage " << NameOf(stage);
    return {stage};
  }

  const std::unique_ptr<Backend> backend_ = MakeCpuBackend(1);
  DatasetSize dataset_;
  TrainingSettings settings_;
  EstimateTools tools_;
};

TEST_F(EstimateStagesTest, ListsTheStagesThatRun) {
  EXPECT_THAT(Stages(), ElementsAre("prepare", "reconstruct", "evaluate", "features", "index"));
  dataset_.has_poses = false;
  dataset_.num_given_gaussians = 1000;
  EXPECT_THAT(Stages(), ElementsAre("prepare", "sfm", "evaluate", "features", "index"));
}

// A training of the same files would have the same plan: see FactsOf of TrainingInputs.
TEST_F(EstimateStagesTest, ExpectsTheTimesOfThePlan) {
  dataset_.has_poses = false;
  settings_.import.image_scale = 0.5;  // num_pixels counts after it
  const TrainingFacts facts = FactsOf(*backend_, dataset_, settings_, tools_);
  EXPECT_DOUBLE_EQ(facts.megapixels, 1);
  EXPECT_DOUBLE_EQ(facts.photo_megapixels, 4);
  EXPECT_TRUE(facts.has_masks);
  EXPECT_FALSE(facts.on_device);
  const std::vector<PlannedStage> plan = PlanStages(facts, settings_);
  const std::vector<StageNeed> needs = Estimate();
  ASSERT_EQ(needs.size(), plan.size());
  for (size_t i = 0; i < plan.size(); ++i) {
    EXPECT_EQ(needs[i].stage, plan[i].stage);
    EXPECT_EQ(needs[i].seconds, plan[i].seconds) << NameOf(plan[i].stage);
    EXPECT_GT(needs[i].seconds.value_or(0), 0) << NameOf(plan[i].stage);
  }
}

TEST_F(EstimateStagesTest, CountsTheTimeToReadVideos) {
  const double none = *Need(Stage::kPrepare).seconds;
  dataset_.video_megapixels = 1800 * 2.07;  // a minute at 30 frames a second, 1920x1080
  const double minute = *Need(Stage::kPrepare).seconds - none;
  EXPECT_GT(minute, 1);
  dataset_.video_megapixels *= 10;
  EXPECT_NEAR(*Need(Stage::kPrepare).seconds - none, 10 * minute, 1e-9);
}

TEST_F(EstimateStagesTest, OmitsFeaturesWithoutMasks) {
  dataset_.training.num_masked_views = 0;
  settings_.priors.masks = PriorMaker::kNone;
  EXPECT_THAT(Stages(), ElementsAre("prepare", "reconstruct", "evaluate", "index"));
  settings_.priors.masks = PriorMaker::kAuto;
  EXPECT_THAT(Stages(),
              ElementsAre("prepare", "reconstruct", "evaluate", "priors", "features", "index"));
}

TEST_F(EstimateStagesTest, CountsSamInTheStagesThatItRunsNextToAndInItsOwn) {
  dataset_.training.num_masked_views = 0;
  dataset_.has_poses = false;
  const int64_t poses = Need(Stage::kSfm).host_bytes,
                stage_one = Need(Stage::kReconstruct).host_bytes;
  tools_.has_sam = true;
  EXPECT_THAT(Stages(), ElementsAre("prepare", "sfm", "reconstruct", "evaluate", "priors",
                                    "features", "index"));
  EXPECT_EQ(Need(Stage::kSfm).host_bytes - poses, SamHostBytes(tools_.num_threads));
  EXPECT_EQ(Need(Stage::kReconstruct).host_bytes - stage_one, SamHostBytes(tools_.num_threads));
  const double on_one_core = *Need(Stage::kPriors).seconds;
  tools_.num_threads = 4;
  EXPECT_DOUBLE_EQ(*Need(Stage::kPriors).seconds, on_one_core / 4);
  tools_.has_priors_command = true;
  EXPECT_FALSE(Need(Stage::kPriors).seconds.has_value());  // the speed of the command is unknown
}

// A device that lacks the room for photographs leaves them on the host.
TEST_F(EstimateStagesTest, MovesPhotographsToTheHostWhereTheDeviceLacksRoom) {
  const StageNeed need = Need(Stage::kReconstruct);
  tools_.device_memory = need.device_bytes;
  EXPECT_EQ(Need(Stage::kReconstruct).device_bytes, need.device_bytes);
  tools_.device_memory = need.device_bytes - 1;
  const StageNeed moved = Need(Stage::kReconstruct);
  const int64_t photographs = dataset_.training.num_training_views * 3 * int64_t{1'000'000};
  EXPECT_LE(moved.device_bytes, need.device_bytes - photographs);
  EXPECT_EQ(moved.device_bytes + moved.host_bytes, need.device_bytes + need.host_bytes);
}

TEST_F(EstimateStagesTest, DecodesOnAsManyThreadsAsThereAre) {
  const int64_t one = Need(Stage::kPrepare).host_bytes;
  tools_.num_threads = 4;
  EXPECT_EQ(Need(Stage::kPrepare).host_bytes - one, 3 * 16 * dataset_.max_source_pixels);
}

TEST_F(EstimateStagesTest, NeedsMoreMemoryForMoreGaussians) {
  settings_.reconstruct.max_gaussians = 100'000;
  const StageNeed few = Need(Stage::kReconstruct);
  settings_.reconstruct.max_gaussians = 1'000'000;
  const StageNeed many = Need(Stage::kReconstruct);
  EXPECT_GT(few.device_bytes, 0);
  EXPECT_GT(many.device_bytes, few.device_bytes);
}

}  // namespace
}  // namespace pepeseg
