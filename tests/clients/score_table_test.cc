#include "clients/cli/score_table.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "absl/strings/str_format.h"

namespace pepeseg::client::cli {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

v1::View Scored(const std::string& name, double psnr, double ssim) {
  v1::View view;
  view.set_view(name);
  view.mutable_scores()->set_psnr(psnr);
  view.mutable_scores()->set_ssim(ssim);
  return view;
}

TEST(ScoreTable, HasTheHeldOutViewsAndTheirMean) {
  v1::View trained;
  trained.set_view("b.jpg");
  const std::vector<v1::View> views = {Scored("a/long_name.jpg", 21, 0.75), trained,
                                       Scored("c.jpg", 24.5, 0.875)};
  EXPECT_THAT(ScoreTable(views), ElementsAre("held-out view      PSNR    SSIM",  //
                                             "a/long_name.jpg   21.00   0.750",  //
                                             "c.jpg             24.50   0.875",  //
                                             "mean of 2         22.75   0.812"));
}

TEST(ScoreTable, HasLpipsWhereItWasMeasured) {
  std::vector<v1::View> views = {Scored("a.jpg", 21, 0.75)};
  views[0].mutable_scores()->set_lpips(0.125);
  EXPECT_THAT(ScoreTable(views), ElementsAre("held-out view    PSNR    SSIM   LPIPS",
                                             "a.jpg           21.00   0.750   0.125",
                                             "mean of 1       21.00   0.750   0.125"));
}

TEST(ScoreTable, OfManyViewsHasTheWorst) {
  std::vector<v1::View> views;
  views.reserve(50);
  for (int i = 0; i < 50; ++i) views.push_back(Scored(absl::StrFormat("%02d", i), 50 - i, 0.5));
  const std::vector<std::string> rows = ScoreTable(views);
  ASSERT_EQ(rows.size(), 22U);
  EXPECT_EQ(rows[0], "worst held-out views    PSNR    SSIM");
  EXPECT_EQ(rows[1], "49                      1.00   0.500");
  EXPECT_EQ(rows[20], "30                     20.00   0.500");
  EXPECT_EQ(rows[21], "mean of 50             25.50   0.500");
}

TEST(ScoreTable, OfNoScoresIsNone) { EXPECT_THAT(ScoreTable(std::vector<v1::View>(3)), IsEmpty()); }

}  // namespace
}  // namespace pepeseg::client::cli
