#include "core/train/training_metrics.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/train/training_inputs.h"

namespace pepeseg {
namespace {

using ::testing::ElementsAre;
using ::testing::Pair;

TEST(TrainingMetrics, HaveTheNamesOfModels) {
  TrainingMetrics metrics = {.num_masks = 3, .psnr = 25.5};
  metrics.seconds[static_cast<size_t>(Stage::kFeatures)] = 2;
  metrics.core_seconds[static_cast<size_t>(Stage::kSfm)] = 8;
  EXPECT_THAT(metrics.ByName(), ElementsAre(Pair("core_seconds_sfm", 8), Pair("num_masks", 3),
                                            Pair("psnr", 25.5), Pair("seconds_features", 2)));
}

TEST(TrainingMetrics, TakeOverWhatIsMeasured) {
  TrainingMetrics metrics = {.num_masks = 3, .psnr = 25.5};
  metrics.Merge({.num_gaussians = 7, .psnr = 26});
  EXPECT_THAT(metrics.ByName(),
              ElementsAre(Pair("num_gaussians", 7), Pair("num_masks", 3), Pair("psnr", 26)));
}

TEST(TrainingMetrics, HaveNoMeansWithoutScores) {
  EXPECT_TRUE(MeansOf({}).ByName().empty());
  const std::vector<ViewScores> scores = {{"a", {20, 0.5, 0.25}}, {"b", {30, 0.7}}};
  EXPECT_THAT(MeansOf(scores).ByName(),
              ElementsAre(Pair("lpips", 0.25), Pair("psnr", 25), Pair("ssim", 0.6)));
}

TEST(Sources, AreNamedOnceTheyAreKnown) {
  Sources sources;
  EXPECT_TRUE(ByName(sources).empty());
  sources.poses = {Source::Kind::kProgram, "COLMAP 3.8"};
  sources.masks = {Source::Kind::kSamAndEmbedded};
  EXPECT_THAT(ByName(sources),
              ElementsAre(Pair("masks", "sam and embedded"), Pair("poses", "COLMAP 3.8")));
  sources.depth = {Source::Kind::kNone};
  EXPECT_EQ(ByName(sources).at("depth"), "none");
}

}  // namespace
}  // namespace pepeseg
