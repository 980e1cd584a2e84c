#include "server/worker_protocol/job_stage.h"

#include <gtest/gtest.h>

#include <set>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"

namespace pepeseg {
namespace {

using Skipped = v1::JobEvent::TermSkipped;

TEST(JobStage, ConvertsEveryStageToItsNameAndBack) {
  std::set<std::string> names;
  for (int number = 1; number < v1::JobStage_ARRAYSIZE; ++number) {
    const auto stage = static_cast<v1::JobStage>(number);
    const std::string name = NameOfStage(stage);
    names.insert(name);
    EXPECT_EQ(absl::StrCat("JOB_STAGE_", absl::AsciiStrToUpper(name)), v1::JobStage_Name(stage));
    EXPECT_EQ(StageOfName(name), stage);
  }
  EXPECT_EQ(names, (std::set<std::string>{"prepare", "sfm", "priors", "reconstruct", "evaluate",
                                          "features", "index"}));
}

TEST(JobStage, IsUnspecifiedForOtherNames) {
  for (const char* name : {"", "Prepare", "prepare ", "JOB_STAGE_SFM"}) {
    EXPECT_EQ(StageOfName(name), v1::JOB_STAGE_UNSPECIFIED) << name;
  }
  EXPECT_EQ(NameOfStage(v1::JOB_STAGE_UNSPECIFIED), "");
  EXPECT_EQ(NameOfStage(static_cast<v1::JobStage>(77)), "");
}

TEST(JobStage, ConvertsEveryStageOfCore) {
  for (int number = 0; number < kNumStages; ++number) {
    const auto stage = static_cast<Stage>(number);
    EXPECT_EQ(NameOfStage(ToProto(stage)), NameOf(stage));
  }
}

TEST(SkippedPart, HasTheNameOfItsTerm) {
  for (int number = 0; number < kNumParts; ++number) {
    const auto part = static_cast<Part>(number);
    EXPECT_EQ(absl::StrCat("TERM_", absl::AsciiStrToUpper(NameOf(part))),
              Skipped::Term_Name(ToProto(part)));
  }
}

}  // namespace
}  // namespace pepeseg
