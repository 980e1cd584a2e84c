#include <gtest/gtest.h>

#include <vector>

#include "core/dataset/import.h"
#include "tests/testing/small_dataset.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

using absl::StatusCode::kInvalidArgument;

const std::vector<std::string> kPhotographs = {"a.jpg", "b.jpg", "sub/c.png"};

TEST(HeldOutViews, TakeThePlaceOfEveryNth) {
  const ImportOptions options{.held_out_every = 2, .held_out_views = {"b.jpg"}};
  EXPECT_FALSE(IsHeldOut(options, "a.jpg", 0));
  EXPECT_TRUE(IsHeldOut(options, "b.jpg", 1));
  EXPECT_FALSE(IsHeldOut(options, "sub/c.png", 2));
  EXPECT_EQ(NumHeldOut(options, 3), 1);
  EXPECT_TRUE(IsHeldOut({.held_out_every = 2}, "sub/c.png", 2));
  EXPECT_EQ(NumHeldOut({.held_out_views = {"a.jpg", "a.jpg", "b.jpg"}}, 3), 2);
  EXPECT_EQ(NumHeldOut({.held_out_every = 2}, 3), 2);
  EXPECT_EQ(NumHeldOut({.held_out_every = 0}, 3), 0);
}

TEST(HeldOutViews, AreNamedWithOrWithoutTheFolderOfPhotographs) {
  const ImportOptions options{.held_out_views = {"images/sub/c.png"}};
  EXPECT_OK(CheckHeldOutViews(options, kPhotographs));
  EXPECT_TRUE(IsHeldOut(options, "sub/c.png", 2));
}

TEST(HeldOutViews, RefuseAnUnknownNameWithTheNearest) {
  EXPECT_STATUS(CheckHeldOutViews({.held_out_views = {"c"}}, kPhotographs), kInvalidArgument,
                "no photograph \"c\"");
  EXPECT_STATUS(CheckHeldOutViews({.held_out_views = {"b.jpeg"}}, kPhotographs), kInvalidArgument,
                "names like it: b.jpg, a.jpg");
  // The suffix is missing: nearer than a name that differs in one letter.
  EXPECT_STATUS(CheckHeldOutViews({.held_out_views = {"sub/c"}}, kPhotographs), kInvalidArgument,
                "names like it: sub/c.png");
}

TEST(HeldOutViews, LeaveAViewToTrainOn) {
  EXPECT_STATUS(CheckHeldOutViews({.held_out_views = kPhotographs}, kPhotographs), kInvalidArgument,
                "all 3 photographs are held out");
  EXPECT_OK(CheckHeldOutViews({.held_out_views = {"a.jpg", "a.jpg", "b.jpg"}}, kPhotographs));
}

TEST(HeldOutViews, AreHeldOutByTheImport) {
  testing::SmallDataset dataset;
  dataset.Write();
  ASSERT_OK_AND_ASSIGN(const Capture capture, dataset.Import({.held_out_views = {"b.jpg"}}));
  ASSERT_EQ(capture.views.size(), 3u);
  EXPECT_FALSE(capture.views[0].held_out);
  EXPECT_TRUE(capture.views[1].held_out);
  EXPECT_FALSE(capture.views[2].held_out);
  EXPECT_STATUS(dataset.Import({.held_out_views = {"d.jpg"}}), kInvalidArgument, "\"d.jpg\"");
}

}  // namespace
}  // namespace pepeseg
