#include "clients/cpp/option_setting.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "clients/cpp/nearest_names.h"
#include "pepeseg/v1/training_options.pb.h"
#include "tests/testing/status_testing.h"

namespace pepeseg::client {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

TEST(SetOption, SetsAFieldOfItsType) {
  v1::TrainingOptions options;
  ASSERT_OK(SetOption("reconstruct.num_steps=3000", options));
  ASSERT_OK(SetOption("reconstruct.densify_until=0.25", options));
  ASSERT_OK(SetOption("reconstruct.seed=18446744073709551615", options));
  ASSERT_OK(SetOption("features.learning_rate=1e-3", options));
  ASSERT_OK(SetOption("reconstruct.depth_local_form=patch", options));
  ASSERT_OK(SetOption("reconstruct.capture_kind=CAPTURE_KIND_FORWARD_FACING", options));
  EXPECT_EQ(options.reconstruct().num_steps(), 3000);
  EXPECT_EQ(options.reconstruct().densify_until(), 0.25);
  EXPECT_EQ(options.reconstruct().seed(), 18446744073709551615U);
  EXPECT_FLOAT_EQ(options.features().learning_rate(), 1e-3F);
  EXPECT_EQ(options.reconstruct().depth_local_form(), v1::DEPTH_LOCAL_FORM_PATCH);
  EXPECT_EQ(options.reconstruct().capture_kind(), v1::CAPTURE_KIND_FORWARD_FACING);
  EXPECT_FALSE(options.has_import());
}

TEST(SetOption, RefusesUnknownOptions) {
  v1::TrainingOptions options;
  for (const char* setting : {"reconstruct.nothing=1", "nothing=1", "reconstruct=1",
                              "reconstruct.num_steps.deep=1", "=1", ".=1"}) {
    const absl::Status status = SetOption(setting, options);
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << setting;
    EXPECT_THAT(std::string(status.message()), HasSubstr("--list-options"));
  }
}

TEST(SetOption, ProposesSimilarOptions) {
  v1::TrainingOptions options;
  const auto message = [&](const char* setting) {
    return std::string(SetOption(setting, options).message());
  };
  EXPECT_THAT(message("reconstruct.num_step=1"), HasSubstr("mean reconstruct.num_steps"));
  EXPECT_THAT(message("recontsruct.seed=1"), HasSubstr("mean reconstruct.seed"));
  EXPECT_THAT(message("image_scale=0.5"), HasSubstr("mean import.image_scale?"));
  EXPECT_THAT(message("preste=best"), HasSubstr("mean preset?"));
  EXPECT_THAT(message("zzz=1"), Not(HasSubstr("did you mean")));
  EXPECT_THAT(message("reconstruct.depth_local_form=circle"),
              HasSubstr("unspecified, windows, patch"));
}

TEST(NearestNames, ReturnsFewWithTheBestFirst) {
  const std::vector<std::string> verbs = {"upload", "train", "watch", "scenes", "segment"};
  EXPECT_THAT(NearestNames("tarin", verbs), ElementsAre("train"));
  EXPECT_THAT(NearestNames("scene", verbs), ElementsAre("scenes"));
  EXPECT_THAT(NearestNames("fly", verbs), IsEmpty());
  EXPECT_THAT(NearestNames("", verbs), IsEmpty());
}

TEST(SetOption, RefusesMalformedValues) {
  v1::TrainingOptions options;
  for (const char* setting :
       {"reconstruct.num_steps=many", "reconstruct.num_steps=", "reconstruct.num_steps=99999999999",
        "reconstruct.num_steps=1.5", "reconstruct.num_steps", "features.seed=-1",
        "reconstruct.depth_local_form=", "reconstruct.depth_local_form=circle"}) {
    EXPECT_EQ(SetOption(setting, options).code(), absl::StatusCode::kInvalidArgument) << setting;
  }
}

TEST(OptionNames, ListEveryOption) {
  EXPECT_THAT(OptionNames(v1::TrainingOptions()), Contains("reconstruct.max_gaussians (int64)"));
}

}  // namespace
}  // namespace pepeseg::client
