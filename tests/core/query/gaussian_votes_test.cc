#include "core/query/gaussian_votes.h"

#include <gtest/gtest.h>

#include "absl/strings/str_cat.h"

namespace pepeseg {
namespace {

// Returns views named "0", "1", ... at the origin that look along z. Those in `away` look back.
std::vector<ModelView> Views(int num, const std::vector<int>& away) {
  std::vector<ModelView> views(static_cast<size_t>(num));
  for (int i = 0; i < num; ++i) {
    views[i].name = absl::StrCat(i);
    views[i].camera = {20, 10, 10, 10, 10, 5};
  }
  for (const int i : away) {
    views[i].cam_from_world.rotation = Eigen::AngleAxisd(3.14159265, Eigen::Vector3d::UnitY());
  }
  return views;
}

std::vector<std::string> Names(const std::vector<ModelView>& views) {
  std::vector<std::string> names;
  names.reserve(views.size());
  for (const ModelView& view : views) names.push_back(view.name);
  return names;
}

using Chosen = std::vector<std::string>;
const Eigen::Vector3d kAhead(0, 0, 2);

TEST(VotingViews, AreSpreadEvenly) {
  EXPECT_EQ(Names(VotingViews(Views(9, {}), "none", kAhead, 3)), (Chosen{"1", "4", "7"}));
  EXPECT_EQ(Names(VotingViews(Views(3, {}), "none", kAhead, 3)), (Chosen{"0", "1", "2"}));
}

TEST(VotingViews, LeaveOutTheViewOfThePrompt) {
  EXPECT_EQ(Names(VotingViews(Views(3, {}), "1", kAhead, 16)), (Chosen{"0", "2"}));
  EXPECT_TRUE(VotingViews(Views(1, {}), "0", kAhead, 16).empty());
  EXPECT_TRUE(VotingViews(Views(5, {}), "0", kAhead, 0).empty());
}

TEST(VotingViews, PreferViewsThatHaveTheCenterInTheirImage) {
  const auto views = Views(6, {0, 2, 4, 5});
  EXPECT_EQ(Names(VotingViews(views, "none", kAhead, 2)), (Chosen{"1", "3"}));
  EXPECT_EQ(Names(VotingViews(views, "none", kAhead, 4)), (Chosen{"1", "3", "2", "5"}));
  // 2.5 to the side at depth 2 is 12.5 pixels from the middle: outside the image.
  const Eigen::Vector3d aside(2.5, 0, 2);
  EXPECT_EQ(VotingViews(Views(2, {}), "none", aside, 2).size(), 2u);
}

}  // namespace
}  // namespace pepeseg
