#include "clients/cli/option_table.h"

#include <gmock/gmock.h>
#include <google/protobuf/util/field_comparator.h>
#include <google/protobuf/util/message_differencer.h>
#include <gtest/gtest.h>

#include <cmath>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "clients/cpp/option_setting.h"
#include "server/api/convert.h"
#include "tests/testing/status_testing.h"

// Compares the table of options with what the server takes.
namespace pepeseg::client::cli {
namespace {

using ::testing::Contains;

bool IsTaken(const std::string& name, const std::string& value) {
  v1::TrainingOptions options;
  options.mutable_features()->set_num_drawn_neighbors(1);  // at most num_neighbors
  return SetOption(absl::StrCat(name, "=", value), options).ok() &&
         TrainingSettingsFromProto(options).ok();
}

TEST(OptionRows, HaveEveryOptionOfTheContract) {
  std::vector<std::string> shown;
  for (const OptionRow& row : OptionRows()) shown.push_back(row.name);
  std::vector<std::string> known;
  for (const std::string& name : OptionNames(v1::TrainingOptions())) {
    known.push_back(name.substr(0, name.find(' ')));
  }
  EXPECT_THAT(shown, ::testing::UnorderedElementsAreArray(known));
}

TEST(OptionRows, HaveTheServersDefaults) {
  const v1::TrainingOptions defaults = ToProto(TrainingSettings());
  for (const OptionRow& row : OptionRows()) {
    if (row.default_value == std::string()) continue;  // an empty list
    v1::TrainingOptions changed = defaults;
    const absl::Status set = SetOption(absl::StrCat(row.name, "=", row.default_value), changed);
    ASSERT_OK(set);
    // The table shows six digits.
    std::string difference;
    google::protobuf::util::MessageDifferencer differencer;
    google::protobuf::util::DefaultFieldComparator comparator;
    comparator.set_float_comparison(google::protobuf::util::DefaultFieldComparator::APPROXIMATE);
    comparator.SetDefaultFractionAndMargin(1e-5, 0);
    differencer.set_field_comparator(&comparator);
    differencer.ReportDifferencesToString(&difference);
    EXPECT_TRUE(differencer.Compare(defaults, changed)) << row.name << ": " << difference;
  }
}

TEST(OptionRows, HaveTheServersRanges) {
  for (const OptionRow& row : OptionRows()) {
    // Ranges are "0 to 1" or "0 to 10, or -1"; enums have none.
    const std::string range = std::string(row.range).substr(0, std::string(row.range).find(','));
    const std::vector<std::string> ends = absl::StrSplit(range, " to ");
    double low = 0, high = 0;
    if (ends.size() != 2 || !absl::SimpleAtod(ends[0], &low) || !absl::SimpleAtod(ends[1], &high)) {
      continue;
    }
    const bool open = std::string(row.name) == "import.image_scale";
    // Converted to float, 1e-12 is a little less than 1e-12 and out of range.
    const bool is_whole = low == std::floor(low);
    const std::string lowest = is_whole ? ends[0] : absl::StrCat(low * (1 + 1e-5));
    EXPECT_EQ(IsTaken(row.name, lowest), !open) << row.name;
    EXPECT_TRUE(IsTaken(row.name, ends[1])) << row.name;
    EXPECT_FALSE(IsTaken(row.name, absl::StrCat(low - 2))) << row.name;
    EXPECT_FALSE(IsTaken(row.name, absl::StrCat(2 * high + 1))) << row.name;
  }
}

TEST(OptionTable, ShowsDefaultsRangesAndNames) {
  const std::vector<std::string> lines = OptionTable();
  EXPECT_THAT(lines.front(), ::testing::StartsWith("OPTION"));
  EXPECT_THAT(lines,
              Contains(::testing::MatchesRegex("reconstruct.num_steps +10000 +1 to 10000000")));
  EXPECT_THAT(
      lines,
      Contains(::testing::MatchesRegex("reconstruct.depth_local_form +windows +windows, patch")));
  EXPECT_THAT(
      lines, Contains(::testing::MatchesRegex("preset +standard +preview, standard, best, paper")));
}

}  // namespace
}  // namespace pepeseg::client::cli
