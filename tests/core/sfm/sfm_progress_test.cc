#include "core/sfm/sfm_progress.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "absl/strings/str_cat.h"

namespace pepeseg {
namespace {

using ::testing::ElementsAre;
using ::testing::Pair;

constexpr SfmWork kWork{.extracting = 20, .matching = 60, .mapping = 20};

// Returns a text like "matching 19 of 190 pairs".
std::string Text(const SfmProgress& progress) {
  return absl::StrCat(std::string(progress.activity()), " ", progress.step(), " of ",
                      progress.num_steps(), " ", std::string(progress.unit()));
}

// The lines below are output of COLMAP 3.8.
TEST(SfmProgress, CountsPhotographsWithFeatures) {
  SfmProgress progress(20, 190, kWork);
  EXPECT_EQ(progress.activity(), "");
  EXPECT_EQ(progress.share(), 0);
  for (const char* line :
       {"Feature extraction", "Processed file [1/20]", "  Name:            c1/000001.jpg",
        "  Dimensions:      640 x 480", "  Camera:          #1 - SIMPLE_RADIAL",
        "  Focal Length:    768.00px", "  Features:        2952", "Processed file [2/20]",
        "  Name:            c1/000003.jpg", "  Features:        17", "Processed file [3/20]",
        "  ERROR: Failed to read image file format."}) {
    progress.Read(line);
  }
  EXPECT_EQ(Text(progress), "finding features in 3 of 20 photographs");
  EXPECT_NEAR(progress.share(), 0.03, 1e-9);
  EXPECT_THAT(progress.num_features(),
              ElementsAre(Pair("c1/000001.jpg", 2952), Pair("c1/000003.jpg", 17)));
}

TEST(SfmProgress, CountsPairsOfExhaustiveMatching) {
  SfmProgress progress(20, 190, kWork);
  progress.Read("Matching block [1/4, 1/4] in 1.174s");
  EXPECT_EQ(Text(progress), "matching 11 of 190 pairs");
  progress.Read("Matching block [3/4, 2/4] in 1.174s");
  EXPECT_EQ(progress.step(), 190 * 10 / 16);
  EXPECT_NEAR(progress.share(), 0.2 + 0.6 * 10 / 16, 1e-9);
  progress.Read("Matching block [4/4, 4/4] in 1.174s");
  EXPECT_EQ(Text(progress), "matching 190 of 190 pairs");
  EXPECT_NEAR(progress.share(), 0.8, 1e-9);
}

TEST(SfmProgress, CountsPhotographsOfSequentialMatching) {
  SfmProgress progress(20, 150, kWork);
  progress.Read("Matching image [5/20] in 0.003s");
  EXPECT_EQ(Text(progress), "matching 5 of 20 photographs");
  EXPECT_NEAR(progress.share(), 0.2 + 0.6 * 5 / 20, 1e-9);
}

TEST(SfmProgress, CountsRegistrationsAndNeverFalls) {
  SfmProgress progress(20, 190, kWork);
  progress.Read("Loading images... 20 in 0.007s (connected 18)");
  EXPECT_EQ(progress.num_connected(), 18);
  progress.Read("Registering image #15 (3)");
  EXPECT_EQ(Text(progress), "placing 2 of 20 photographs");
  progress.Read("Registering image #1 (20)");
  EXPECT_EQ(progress.step(), 19);
  progress.Read("Registering image #4 (3)");  // of a second model
  EXPECT_EQ(progress.step(), 19);
  progress.Read("Matching block [1/4, 1/4] in 1.174s");
  EXPECT_EQ(Text(progress), "placing 19 of 20 photographs") << "no earlier part comes back";
  progress.Finish();
  EXPECT_EQ(progress.step(), 20);
  EXPECT_EQ(progress.share(), 1);
}

TEST(SfmProgress, CountsPairsOfTheOwnMatcher) {
  const SfmWork work{.extracting = 20, .choosing = 10, .matching = 50, .mapping = 20};
  SfmProgress progress(20, 100, work);
  progress.Score(95, 190);
  EXPECT_EQ(Text(progress), "choosing among 95 of 190 pairs");
  EXPECT_NEAR(progress.share(), 0.25, 1e-9);
  progress.Compare(50, 100);
  EXPECT_EQ(Text(progress), "matching 50 of 100 pairs");
  EXPECT_NEAR(progress.share(), 0.55, 1e-9);
  progress.Compare(100, 120);  // it has found more pairs to compare
  EXPECT_EQ(Text(progress), "matching 100 of 120 pairs");
  progress.Compare(101, 300);
  EXPECT_EQ(Text(progress), "matching 101 of 300 pairs");
  EXPECT_GE(progress.share(), 0.55) << "never falls";
}

TEST(SfmProgress, TakesTheShareOfTheOwnMapper) {
  SfmProgress progress(20, 190, kWork);
  progress.Compare(190, 190);
  progress.Place(0.5);
  EXPECT_EQ(progress.activity(), "placing");
  EXPECT_EQ(progress.step(), 10);
  const double half = progress.share();
  progress.Place(1);
  EXPECT_GT(progress.share(), half);
  EXPECT_LT(progress.share(), 1) << "the model may be refused";
  EXPECT_EQ(progress.step(), 19);
  progress.Finish();
  EXPECT_EQ(progress.share(), 1);
}

TEST(SfmWork, ComparesAllPairsOrNeighboursOnly) {
  SfmOptions options;
  options.front = SfmEngine::kColmap;
  EXPECT_EQ(NumSfmPairs({.num_photographs = 20}, options).compared, 190);
  SfmLoad frames{.num_photographs = 20, .in_sequence = true};
  EXPECT_EQ(NumSfmPairs(frames, options).compared, 145 + 4);  // 16 apart: 4 pairs
  options.front = SfmEngine::kAuto;
  EXPECT_EQ(NumSfmPairs({.num_photographs = 20}, options).scored, 0);
  EXPECT_EQ(NumSfmPairs({.num_photographs = 200}, options).scored, 19900);
  EXPECT_EQ(NumSfmPairs({.num_photographs = 200, .on_device = true}, options).scored, 0);
}

// fox, 50 photographs of 0.5 megapixels: 540 core seconds by COLMAP, 67 with the own front, 31 with
// own features as well, 24 with the own mapper as well: 20 were measured before it freed the
// principal point, which takes 1.7 times its part.
TEST(SfmWork, IsThatOfMeasurements) {
  SfmOptions options;
  const SfmLoad fox{.num_photographs = 50, .megapixels = 0.505};
  EXPECT_NEAR(ExpectedSfmWork(fox, options).sum(), 24, 5);
  options.mapper = SfmEngine::kColmap;
  EXPECT_NEAR(ExpectedSfmWork(fox, options).sum(), 31, 7.5);
  options.features = SfmEngine::kColmap;
  const double own = ExpectedSfmWork(fox, options).sum();
  options.front = SfmEngine::kColmap;
  const double by_colmap = ExpectedSfmWork(fox, options).sum();
  EXPECT_NEAR(by_colmap, 500, 100);
  EXPECT_NEAR(own, 70, 25);
}

TEST(SfmWork, CountsColmapsMapperForFewPhotographs) {
  SfmLoad load{.num_photographs = kFewestForOwnMapper - 1};
  const double few = ExpectedSfmWork(load, {}).mapping;
  SfmOptions by_colmap;
  by_colmap.mapper = SfmEngine::kColmap;
  EXPECT_EQ(few, ExpectedSfmWork(load, by_colmap).mapping);
  load.num_photographs = kFewestForOwnMapper;
  EXPECT_NE(ExpectedSfmWork(load, {}).mapping, ExpectedSfmWork(load, by_colmap).mapping);
}

TEST(SfmProgress, IgnoresUnknownLines) {
  SfmProgress progress(20, 190, kWork);
  for (const char* line :
       {"", "Processed file [", "Processed file [x/y]", "Matching block [1/0, 1/0]",
        "Registering image #", "Features: many", "Processed file [99999999999999999999/1]"}) {
    progress.Read(line);
  }
  EXPECT_EQ(progress.step(), 0);
  EXPECT_TRUE(progress.num_features().empty());
  EXPECT_EQ(progress.num_connected(), -1);
}

}  // namespace
}  // namespace pepeseg
