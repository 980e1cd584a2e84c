#include "clients/cli/find.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace pepeseg::client::cli {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

TEST(CheckFound, SaysHowSureAndWhichWordsAreKnown) {
  v1::FindSegmentsResponse answer;
  EXPECT_EQ(CheckFound(answer).message(), "no such thing");
  answer.set_best_score(0.123);
  answer.set_best_word("cup");
  answer.add_did_you_mean("mug");
  for (int i = 0; i < 25; ++i) answer.add_known_words("w" + std::to_string(i));
  const absl::Status status = CheckFound(answer);
  EXPECT_EQ(status.code(), absl::StatusCode::kNotFound);
  EXPECT_THAT(std::string(status.message()),
              ::testing::AllOf(
                  HasSubstr("no such thing (best: 0.12 cup); did you mean mug?; known words: w0, "),
                  HasSubstr(", w19, ...")));
  answer.add_found();
  EXPECT_TRUE(CheckFound(answer).ok());
}

TEST(FoundRows, ListCentreAndSize) {
  v1::FindSegmentsResponse answer;
  auto& found = *answer.add_found();
  found.set_score(0.5);
  found.mutable_segment()->set_level(1);
  found.mutable_segment()->set_id(7);
  found.set_num_gaussians(12);
  found.mutable_box()->mutable_min()->set_x(-1);
  found.mutable_box()->mutable_max()->set_x(3);
  for (const char* const view : {"a", "b", "c", "d"}) found.add_appearances()->set_view(view);
  answer.add_found()->set_word("cup");
  auto& piece = *answer.add_found()->mutable_segment();
  piece.set_id(5);
  for (const double scale : {0.0, 0.01, 0.5, 1.0}) piece.add_scales(scale);
  const std::vector<TableRow> rows = FoundRows(answer);
  ASSERT_EQ(rows.size(), 4u);
  EXPECT_THAT(rows[1], ElementsAre("1", "0.50", "1:7", "1 0 0", "4 0 0", "12", "a b c"));
  EXPECT_THAT(rows[2], ElementsAre("2", "0.00", "cup", "", "", "0", ""));
  EXPECT_EQ(rows[3][2], "piece 5");
}

TEST(ToCsv, QuotesWhatNeedsIt) {
  EXPECT_EQ(ToCsv({{"a", "b c"}, {"d,e", "f\"g"}}), "a,b c\n\"d,e\",\"f\"\"g\"");
}

}  // namespace
}  // namespace pepeseg::client::cli
