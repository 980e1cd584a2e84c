#include "core/sfm/model_agreement.h"

#include <utility>

#include "tests/core/sfm/compared_scene.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::Pair;

class ModelAgreementTest : public ::testing::Test {
 protected:
  ModelAgreement Measure(const std::set<int>& misplaced) const {
    const std::filesystem::path folder = folder_ / "model";
    testing::WriteSceneModel(folder, misplaced);
    const auto model = ReadSfmModel(folder);
    EXPECT_OK(model);
    const auto agreement = MeasureAgreement(compared_.features, compared_.pairs, *model, 4);
    EXPECT_OK(agreement);
    return *agreement;
  }

  testing::TempFolder folder_;
  ComparedDatabase compared_ = testing::CompareScene();
};

TEST_F(ModelAgreementTest, CountsAllMatchesOfTheTruePoses) {
  const ModelAgreement agreement = Measure({});
  EXPECT_EQ(agreement.agreeing, 10 * testing::kNumPoints);
  EXPECT_EQ(agreement.disagreeing, 0);
  EXPECT_TRUE(agreement.IsPlausible());
}

TEST_F(ModelAgreementTest, DoubtsAMisplacedPhotographAndNotItsNeighbours) {
  const ModelAgreement agreement = Measure({3});
  EXPECT_THAT(agreement.doubtful, ElementsAre("c1/000004.jpg"));
  EXPECT_FALSE(agreement.IsPlausible());
  EXPECT_GT(agreement.disagreeing, 3 * testing::kNumPoints);
  EXPECT_LE(agreement.disagreeing, 4 * testing::kNumPoints);
}

// A wallpaper: every fourth match of one pair is one of its repetitions away.
TEST_F(ModelAgreementTest, ToleratesWrongMatchesOfAPair) {
  for (size_t k = 0; k < testing::kNumPoints; k += 4) {
    FeatureMatch& match = compared_.pairs[3].geometry.inliers[k];
    match.second = static_cast<uint32_t>((k + 100) % testing::kNumPoints);
  }
  const ModelAgreement agreement = Measure({});
  EXPECT_GT(agreement.disagreeing, 30);
  EXPECT_LE(agreement.disagreeing, testing::kNumPoints / 4);
  EXPECT_TRUE(agreement.IsPlausible());
}

// Four wrong pairs in ten, so that no photograph has most of them.
TEST_F(ModelAgreementTest, FindsAModelImplausibleWithoutADoubtfulPhotograph) {
  for (const size_t pair : {0u, 2u, 7u, 9u}) {
    for (size_t k = 0; k < testing::kNumPoints; k += 2) {
      compared_.pairs[pair].geometry.inliers[k].second =
          static_cast<uint32_t>((k + 100) % testing::kNumPoints);
    }
  }
  const ModelAgreement agreement = Measure({});
  EXPECT_THAT(agreement.doubtful, IsEmpty());
  EXPECT_FALSE(agreement.IsPlausible());
}

TEST_F(ModelAgreementTest, IgnoresPhotographsWithoutAPose) {
  compared_.features.images[0].name = "c1/another.jpg";
  EXPECT_EQ(Measure({}).agreeing, 6 * testing::kNumPoints);
}

TEST_F(ModelAgreementTest, RefusesAModelCutShort) {
  testing::WriteSceneModel(folder_ / "model", {});
  ASSERT_OK_AND_ASSIGN(const SfmModel model, ReadSfmModel(folder_ / "model"));
  std::filesystem::resize_file(folder_ / "model/cameras.bin", 20);
  EXPECT_STATUS(MeasureAgreement(compared_.features, compared_.pairs, model, 4),
                absl::StatusCode::kInvalidArgument, "cameras.bin");
}

TEST_F(ModelAgreementTest, StartsFromPairsWithMostMatchesOffAPlane) {
  std::vector<ComparedPair>& pairs = compared_.pairs;
  pairs.resize(4);
  pairs[0].geometry.inliers.resize(100);
  pairs[1].geometry.kind = TwoViewKind::kPlanarOrPanoramic;
  pairs[3].geometry.inliers.resize(29);
  const auto best = InitialPairs(compared_.features, pairs, 3, 4);
  EXPECT_THAT(best, ElementsAre(Pair(1, 4), Pair(1, 2)));
  EXPECT_THAT(InitialPairs(compared_.features, pairs, 1, 4), ElementsAre(Pair(1, 4)));
  EXPECT_THAT(InitialPairs(compared_.features, pairs, 3, 1e6), IsEmpty()) << "all are on the plane";
}

}  // namespace
}  // namespace pepeseg
