#include "clients/cpp/option_setting.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "clients/cpp/nearest_names.h"
#include "tests/testing/status_testing.h"

namespace pepeseg::client {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

TEST(SetOption, LeavesNamesAndValuesToTheServer) {
  v1::TrainingOptions options;
  ASSERT_OK(SetOption("reconstruct.num_steps=3000", options));
  ASSERT_OK(SetOption("reconstruct.num_steps=4000", options));
  ASSERT_OK(SetOption("no.such.option=a=b", options));
  EXPECT_EQ(options.advanced().at("reconstruct.num_steps"), "4000");
  EXPECT_EQ(options.advanced().at("no.such.option"), "a=b");
  EXPECT_EQ(options.advanced().size(), 2u);
}

TEST(SetOption, SetsThePresetAndAddsHeldOutViews) {
  v1::TrainingOptions options;
  ASSERT_OK(SetOption("preset=best", options));
  ASSERT_OK(SetOption("import.held_out_views=a.jpg", options));
  ASSERT_OK(SetOption("import.held_out_views=b.jpg", options));
  EXPECT_EQ(options.preset(), v1::TRAINING_PRESET_BEST);
  EXPECT_THAT(options.import().held_out_views(), ElementsAre("a.jpg", "b.jpg"));
  EXPECT_THAT(options.advanced(), IsEmpty());
}

TEST(SetOption, RefusesUnknownPresetsAndSettingsWithoutAValue) {
  v1::TrainingOptions options;
  EXPECT_STATUS(SetOption("preset=quick", options), absl::StatusCode::kInvalidArgument,
                "preview, standard, best, paper");
  EXPECT_STATUS(SetOption("reconstruct.num_steps", options), absl::StatusCode::kInvalidArgument,
                "expected NAME=VALUE");
}

TEST(NearestNames, ReturnsFewWithTheBestFirst) {
  const std::vector<std::string> verbs = {"upload", "train", "watch", "scenes", "segment"};
  EXPECT_THAT(NearestNames("tarin", verbs), ElementsAre("train"));
  EXPECT_THAT(NearestNames("scene", verbs), ElementsAre("scenes"));
  EXPECT_THAT(NearestNames("fly", verbs), IsEmpty());
  EXPECT_THAT(NearestNames("", verbs), IsEmpty());
}

}  // namespace
}  // namespace pepeseg::client
