#include "core/train/settings/stage_plan.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/dataset/video_frames.h"
#include "core/priors/sam/sam_segmenter.h"

namespace pepeseg {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::Not;

std::vector<std::string> Names(const std::vector<PlannedStage>& stages) {
  std::vector<std::string> names;
  for (const PlannedStage& stage : stages) names.emplace_back(NameOf(stage.stage));
  return names;
}

const PlannedStage& Find(const std::vector<PlannedStage>& stages, Stage wanted) {
  for (const PlannedStage& stage : stages) {
    if (stage.stage == wanted) return stage;
  }
  ADD_FAILURE() << NameOf(wanted);
  return stages.front();
}

TEST(PlanStages, OmitsStagesWhoseResultIsGiven) {
  TrainingFacts facts;
  facts.num_photographs = 20;
  TrainingSettings settings;
  EXPECT_THAT(
      Names(PlanStages(facts, settings)),
      ElementsAre("prepare", "sfm", "reconstruct", "evaluate", "priors", "features", "index"));
  facts.has_poses = facts.has_masks = facts.has_depth = true;
  EXPECT_THAT(Names(PlanStages(facts, settings)),
              ElementsAre("prepare", "reconstruct", "evaluate", "features", "index"));
  facts.has_gaussians = true;
  EXPECT_THAT(Names(PlanStages(facts, settings)),
              ElementsAre("prepare", "evaluate", "features", "index"));
  facts.has_masks = facts.has_depth = false;
  settings.priors.masks = settings.priors.depth = PriorMaker::kNone;
  EXPECT_THAT(Names(PlanStages(facts, settings)), ElementsAre("prepare", "evaluate", "index"));
}

TEST(PlanStages, CountsTheLengthOfVideos) {
  TrainingFacts facts;
  facts.num_photographs = 20;
  const double without = *Find(PlanStages(facts, {}), Stage::kPrepare).seconds;
  facts.video_megapixels = 1000;
  EXPECT_DOUBLE_EQ(*Find(PlanStages(facts, {}), Stage::kPrepare).seconds,
                   without + 1000 * kVideoCoreSeconds);
}

TEST(PlanStages, HasNoTimeForAPriorsCommand) {
  TrainingFacts facts;
  facts.num_photographs = 20;
  TrainingSettings settings;
  EXPECT_TRUE(Find(PlanStages(facts, settings), Stage::kPriors).seconds.has_value());
  facts.has_priors_command = true;
  EXPECT_FALSE(Find(PlanStages(facts, settings), Stage::kPriors).seconds.has_value());
  settings.priors.masks = settings.priors.depth = PriorMaker::kEmbedded;
  EXPECT_TRUE(Find(PlanStages(facts, settings), Stage::kPriors).seconds.has_value());
}

TEST(PlanStages, HasTheTimeOfSam) {
  TrainingFacts facts;
  facts.num_photographs = 20;
  TrainingSettings settings;
  const double embedded = *Find(PlanStages(facts, settings), Stage::kPriors).seconds;
  facts.has_sam = true;
  EXPECT_DOUBLE_EQ(*Find(PlanStages(facts, settings), Stage::kPriors).seconds,
                   20 * kSamCoreSeconds);
  settings.priors.masks = PriorMaker::kEmbedded;
  EXPECT_DOUBLE_EQ(*Find(PlanStages(facts, settings), Stage::kPriors).seconds, embedded);
  settings.priors.masks = PriorMaker::kSam;
  facts.num_threads = 4;
  EXPECT_DOUBLE_EQ(*Find(PlanStages(facts, settings), Stage::kPriors).seconds,
                   20 * kSamCoreSeconds / 4);
}

TEST(PlanStages, CountsWhatSamDoesOnAGpuNextToOtherStages) {
  TrainingFacts facts;
  facts.num_photographs = 100;
  facts.has_sam = facts.on_device = true;
  facts.has_gaussians = facts.has_poses = true;  // nothing to run next to but the scores
  facts.num_threads = 2;
  const double all = 100 * SamSeconds(2, /*on_device=*/true);
  TrainingSettings settings;
  settings.import.held_out_every = 0;
  EXPECT_DOUBLE_EQ(*Find(PlanStages(facts, settings), Stage::kPriors).seconds, all);
  facts.has_poses = false;
  EXPECT_EQ(*Find(PlanStages(facts, settings), Stage::kPriors).seconds, 0);
  facts.num_to_segment = 8;  // known when the stage starts
  EXPECT_DOUBLE_EQ(*Find(PlanStages(facts, settings), Stage::kPriors).seconds,
                   8 * SamSeconds(2, /*on_device=*/true));
}

TEST(SamSeconds, AreOfTheDeviceOnceEnoughThreadsFeedIt) {
  EXPECT_DOUBLE_EQ(SamSeconds(4, /*on_device=*/false), kSamCoreSeconds / 4);
  EXPECT_DOUBLE_EQ(SamSeconds(1, /*on_device=*/true), kSamHostSeconds);
  EXPECT_GE(SamSeconds(64, /*on_device=*/true), kSamDeviceSeconds);
  EXPECT_LT(SamSeconds(64, /*on_device=*/true), SamSeconds(2, /*on_device=*/true));
}

// A GPU leaves the cores to the built-in methods while it trains.
TEST(PlanStages, MakesBuiltInPriorsNextToStageOneOnADevice) {
  TrainingFacts facts;
  facts.num_photographs = 200;
  facts.megapixels = 1;
  facts.num_threads = 4;
  const double on_cores = *Find(PlanStages(facts, {}), Stage::kPriors).seconds;
  facts.on_device = true;
  const std::vector<PlannedStage> stages = PlanStages(facts, {});
  const double meanwhile =
      *Find(stages, Stage::kReconstruct).seconds + *Find(stages, Stage::kEvaluate).seconds;
  EXPECT_DOUBLE_EQ(*Find(stages, Stage::kPriors).seconds, on_cores - meanwhile);
  facts.num_threads = 64;
  EXPECT_EQ(*Find(PlanStages(facts, {}), Stage::kPriors).seconds, 0);
}

TEST(PlanStages, MakesDepthOnlyWhereItHasAUse) {
  TrainingFacts facts;
  facts.num_photographs = 20;
  TrainingSettings settings;
  const double both = *Find(PlanStages(facts, settings), Stage::kPriors).seconds;
  settings.priors.depth = PriorMaker::kNone;
  EXPECT_LT(*Find(PlanStages(facts, settings), Stage::kPriors).seconds, both);
  facts.has_masks = true;
  settings.priors.depth = PriorMaker::kAuto;
  EXPECT_THAT(Names(PlanStages(facts, settings)), Not(Contains("priors")));
  settings.priors.depth = PriorMaker::kEmbedded;
  EXPECT_THAT(Names(PlanStages(facts, settings)), Contains("priors"));
}

TEST(PlanStages, HasPriorsBeforeStageOneWhereACommandMakesThem) {
  TrainingFacts facts;
  facts.num_photographs = 20;
  facts.has_priors_command = true;
  EXPECT_THAT(Names(PlanStages(facts, {})), ElementsAre("prepare", "sfm", "priors", "reconstruct",
                                                        "evaluate", "features", "index"));
  EXPECT_TRUE(PriorsComeFirst(facts, {}));
  EXPECT_FALSE(PriorsComeFirst(facts, {.masks = PriorMaker::kSam, .depth = PriorMaker::kNone}));
}

TEST(PlanStages, CountsOnlyPhotographsThatSamHasStillToSegment) {
  TrainingFacts facts;
  facts.num_photographs = 20;
  facts.has_sam = true;
  const TrainingSettings settings;
  const double all = *Find(PlanStages(facts, settings), Stage::kPriors).seconds;
  facts.num_to_segment = 7;
  EXPECT_DOUBLE_EQ(*Find(PlanStages(facts, settings), Stage::kPriors).seconds,
                   all - 13 * kSamCoreSeconds);
}

TEST(PlanStages, ExpectsCoarseStepsToTakeLessTime) {
  TrainingFacts facts;
  facts.num_photographs = 20;
  TrainingSettings settings;
  settings.reconstruct.num_steps = 1000;
  settings.reconstruct.megapixels_per_step = 0;  // which would make steps coarse, too
  const double full = *Find(PlanStages(facts, settings), Stage::kReconstruct).seconds;
  settings.reconstruct.coarse_until = 0.5;
  const PlannedStage coarse = Find(PlanStages(facts, settings), Stage::kReconstruct);
  EXPECT_LT(*coarse.seconds, 0.7 * full);
  int64_t num_steps = 0;
  for (const auto& piece : coarse.pieces) num_steps += piece.num_steps;
  EXPECT_EQ(num_steps, 1000);
}

TEST(PlanStages, ExpectsMoreThreadsToTakeLessTimeOnCoresOnly) {
  TrainingFacts facts;
  facts.num_photographs = 20;
  const TrainingSettings settings;
  facts.on_device = true;
  const auto one = PlanStages(facts, settings);
  facts.num_threads = 8;
  const auto eight = PlanStages(facts, settings);
  EXPECT_DOUBLE_EQ(*Find(one, Stage::kEvaluate).seconds,
                   8 * *Find(eight, Stage::kEvaluate).seconds);
  // Features and matches are found in parallel, poses by one thread.
  EXPECT_LT(*Find(eight, Stage::kSfm).seconds, *Find(one, Stage::kSfm).seconds);
  EXPECT_GT(*Find(eight, Stage::kSfm).seconds, *Find(one, Stage::kSfm).seconds / 8);
  EXPECT_DOUBLE_EQ(*Find(one, Stage::kFeatures).seconds, *Find(eight, Stage::kFeatures).seconds);
}

TEST(RunsPrograms, IsTrueForPosesAndForARequestedCommand) {
  TrainingFacts facts;
  PriorOptions priors;
  EXPECT_TRUE(RunsPrograms(facts, priors)) << "COLMAP estimates the poses";
  facts.has_poses = true;
  EXPECT_FALSE(RunsPrograms(facts, priors));
  facts.has_priors_command = true;
  EXPECT_TRUE(RunsPrograms(facts, priors));
  facts.has_masks = true;
  EXPECT_TRUE(RunsPrograms(facts, priors)) << "the command makes depth";
  priors.depth = PriorMaker::kEmbedded;
  EXPECT_FALSE(RunsPrograms(facts, priors));
}

}  // namespace
}  // namespace pepeseg
