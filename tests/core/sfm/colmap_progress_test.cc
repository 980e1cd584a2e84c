#include "core/sfm/colmap_progress.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace pepeseg {
namespace {

using ::testing::ElementsAre;
using ::testing::Pair;

// Lines of COLMAP 3.8.
TEST(ColmapProgress, CountsFeatures) {
  ColmapProgress progress(20);
  EXPECT_EQ(progress.num_steps(), 60);
  for (const char* line :
       {"Feature extraction", "Processed file [1/20]", "  Name:            c1/000001.jpg",
        "  Dimensions:      640 x 480", "  Camera:          #1 - SIMPLE_RADIAL",
        "  Focal Length:    768.00px", "  Features:        2952", "Processed file [2/20]",
        "  Name:            c1/000003.jpg", "  Features:        17", "Processed file [3/20]",
        "  ERROR: Failed to read image file format."}) {
    progress.Read(line);
  }
  EXPECT_EQ(progress.step(), 3);
  EXPECT_THAT(progress.num_features(),
              ElementsAre(Pair("c1/000001.jpg", 2952), Pair("c1/000003.jpg", 17)));
}

TEST(ColmapProgress, CountsMatches) {
  ColmapProgress progress(20);
  progress.Read("Matching block [1/4, 1/4] in 1.174s");
  EXPECT_EQ(progress.step(), 20 + 20 / 16);
  progress.Read("Matching block [3/4, 2/4] in 1.174s");
  EXPECT_EQ(progress.step(), 20 + 20 * 10 / 16);
  progress.Read("Matching block [4/4, 4/4] in 1.174s");
  EXPECT_EQ(progress.step(), 40);
  ColmapProgress sequential(20);
  sequential.Read("Matching image [5/20] in 0.003s");
  EXPECT_EQ(sequential.step(), 25);
}

TEST(ColmapProgress, CountsRegistrationsAndNeverFalls) {
  ColmapProgress progress(20);
  progress.Read("Loading images... 20 in 0.007s (connected 18)");
  EXPECT_EQ(progress.num_connected(), 18);
  progress.Read("Registering image #15 (3)");
  EXPECT_EQ(progress.step(), 42);
  progress.Read("Registering image #1 (20)");
  EXPECT_EQ(progress.step(), 59);
  progress.Read("Registering image #4 (3)");  // of a second model
  EXPECT_EQ(progress.step(), 59);
}

TEST(ColmapProgress, PassesOverWhatItDoesNotKnow) {
  ColmapProgress progress(20);
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
