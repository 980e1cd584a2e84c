#include "server/services/text_sightings.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "absl/strings/str_cat.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

constexpr SearchedPhotograph kPhoto = {8, 4, 4, 2};

absl::StatusOr<std::vector<Sighting>> Parse(const std::string& text) {
  return ParseTextSightings(text, "000001.json", kPhoto);
}

TEST(TextSightings, HaveBoxesInSharesOfTheView) {
  ASSERT_OK_AND_ASSIGN(const auto things,
                       Parse(R"([{"score": 0.5, "box": [2, 1, 6, 9], "label": "cup"}])"));
  ASSERT_EQ(things.size(), 1);
  EXPECT_EQ(things[0].word, 0);
  EXPECT_FLOAT_EQ(things[0].score, 0.5F);
  EXPECT_FLOAT_EQ(things[0].x0, 0.25F);
  EXPECT_FLOAT_EQ(things[0].y0, 0.25F);
  EXPECT_FLOAT_EQ(things[0].x1, 0.75F);
  EXPECT_FLOAT_EQ(things[0].y1, 1);  // cut at the photograph's side
}

TEST(TextSightings, HaveMasksOnTheGrid) {
  // The left three columns, then the rest: runs go down the columns.
  for (const char* counts : {"[0, 12, 20]", "\"0<d0\""}) {
    ASSERT_OK_AND_ASSIGN(
        const auto things,
        Parse(absl::StrCat(R"([{"score": 1, "segmentation": {"size": [4, 8], "counts": )", counts,
                           "}}]")));
    ASSERT_EQ(things.size(), 1) << counts;
    EXPECT_EQ(things[0].mask_width, 4);
    EXPECT_EQ(things[0].mask_height, 2);
    EXPECT_THAT(things[0].mask.pixels, ::testing::ElementsAre(1, 0, 0, 0, 1, 0, 0, 0)) << counts;
  }
}

TEST(TextSightings, LeaveOutWhatIsEmptyOrHasNoScore) {
  ASSERT_OK_AND_ASSIGN(
      const auto things,
      Parse(R"([{"score": 0, "box": [1, 1, 2, 2]}, {"score": 0.5, "box": [3, 1, 3, 2]},
                              {"score": 0.5, "segmentation": {"size": [4, 8], "counts": [32]}}])"));
  EXPECT_TRUE(things.empty());
  EXPECT_OK(Parse("[]").status());
}

TEST(TextSightings, SayWhatIsWrong) {
  const auto expect = [](const std::string& text, const std::string& words) {
    EXPECT_STATUS(Parse(text), absl::StatusCode::kInvalidArgument, words);
  };
  expect("[{", "000001.json: is not JSON");
  expect("{}", "000001.json: is not a list");
  expect("[7]", "000001.json: thing 1: has no \"score\"");
  expect(R"([{"score": 0.5, "box": [0, 0, 1, 1]}, {"score": 2, "box": [0, 0, 1, 1]}])",
         "thing 2: its \"score\" is above 1");
  expect(R"([{"score": 0.5}])", "has neither a \"box\" nor a \"segmentation\"");
  expect(R"([{"score": 0.5, "box": [0, 0, 1]}])", "is not a list [x0, y0, x1, y1]");
  expect(R"([{"score": 0.5, "box": [0, 0, 1, "a"]}])", "has a side that is not a number");
  expect(R"([{"score": 0.5, "segmentation": {"size": [8, 4], "counts": [32]}}])",
         "is not the photograph's, [4, 8]");
  expect(R"([{"score": 0.5, "segmentation": {"size": [4, 8], "counts": [31]}}])",
         "the runs cover 31");
  expect(R"([{"score": 0.5, "segmentation": {"size": [4, 8]}}])", "\"counts\" is neither");
  std::string many = "[{}";
  for (size_t i = 0; i < kMostTextThings; ++i) many += ",{}";
  expect(many + "]", "has 201 things; the limit is 200");
}

}  // namespace
}  // namespace pepeseg
