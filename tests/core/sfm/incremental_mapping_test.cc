#include "core/sfm/incremental_mapping.h"

#include <algorithm>

#include "tests/core/sfm/compared_scene.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

using ::testing::Contains;
using ::testing::IsEmpty;
using ::testing::Not;

// A mapper whose runs give models with other misplaced photographs.
class IncrementalMappingTest : public ::testing::Test {
 protected:
  IncrementalMappingTest() { std::filesystem::create_directories(input_.models); }

  absl::StatusOr<MappedModels> Map(const std::vector<std::set<int>>& misplaced) {
    return MapIncrementally(input_, [&](const ColmapProgram::Command& command) {
      const std::vector<std::string>& words = command.arguments;
      const auto output = std::find(words.begin(), words.end(), "--output_path");
      EXPECT_LT(runs_.size(), misplaced.size());
      if (runs_.size() >= misplaced.size()) return absl::InternalError("too many runs");
      const std::set<int>& of_run = misplaced[runs_.size()];
      runs_.push_back(words);
      // Without a model: no pair to start from.
      if (!of_run.contains(-1)) testing::WriteSceneModel(*std::next(output) + "/0", of_run);
      return absl::OkStatus();
    });
  }

  testing::TempFolder folder_;
  ComparedDatabase compared_ = testing::CompareScene();
  MappingInput input_{"own.db", "images", folder_ / "models", "2", &compared_};
  std::vector<std::vector<std::string>> runs_;
};

TEST_F(IncrementalMappingTest, MapsOnceIfTheModelAgreesWithTheMatches) {
  ASSERT_OK_AND_ASSIGN(const MappedModels mapped, Map({{}}));
  EXPECT_EQ(mapped.models.size(), 1u);
  EXPECT_TRUE(mapped.agreement.IsPlausible());
  ASSERT_EQ(runs_.size(), 1u);
  EXPECT_THAT(runs_[0], Not(Contains("--Mapper.init_image_id1"))) << "COLMAP chooses";
}

TEST_F(IncrementalMappingTest, StartsFromOtherPairsUntilTheModelAgrees) {
  ASSERT_OK_AND_ASSIGN(const MappedModels mapped, Map({{1, 2}, {-1}, {}}));
  ASSERT_EQ(runs_.size(), 3u);
  EXPECT_THAT(runs_[1], Contains("--Mapper.init_image_id1"));
  EXPECT_NE(runs_[1], runs_[2]);
  EXPECT_TRUE(mapped.agreement.IsPlausible());
  EXPECT_EQ(mapped.models.front().folder, input_.models / "2" / "0");
}

TEST_F(IncrementalMappingTest, KeepsTheModelWithMostAgreeingMatches) {
  ASSERT_OK_AND_ASSIGN(const MappedModels mapped, Map({{1, 2}, {1, 2, 3}, {4}, {0, 4}}));
  EXPECT_EQ(runs_.size(), 4u);
  EXPECT_FALSE(mapped.agreement.IsPlausible());
  EXPECT_THAT(mapped.agreement.doubtful, ::testing::ElementsAre("c1/000005.jpg"));
  EXPECT_EQ(mapped.models.front().folder, input_.models / "2" / "0");
}

TEST_F(IncrementalMappingTest, MapsOnceWithoutAModel) {
  ASSERT_OK_AND_ASSIGN(const MappedModels mapped, Map({{-1}}));
  EXPECT_THAT(mapped.models, IsEmpty());
}

TEST_F(IncrementalMappingTest, DoesNotJudgeWhereColmapCompared) {
  input_.compared = nullptr;
  ASSERT_OK_AND_ASSIGN(const MappedModels mapped, Map({{1, 2}}));
  EXPECT_EQ(mapped.models.size(), 1u);
  EXPECT_THAT(runs_[0], Not(Contains("--Mapper.ba_global_images_ratio")));
}

}  // namespace
}  // namespace pepeseg
