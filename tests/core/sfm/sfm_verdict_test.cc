#include "core/sfm/sfm_verdict.h"

#include <string>

#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;
constexpr auto kRefused = absl::StatusCode::kFailedPrecondition;

// Returns evidence of photographs p0, p1, ... that have many features and are all connected.
SfmEvidence Photographs(size_t count) {
  SfmEvidence evidence;
  for (size_t i = 0; i < count; ++i) evidence.names.push_back("p" + std::to_string(i));
  evidence.num_features.assign(count, 3000);
  evidence.num_connected = static_cast<int64_t>(count);
  return evidence;
}

std::vector<size_t> Range(size_t begin, size_t end) {
  std::vector<size_t> range;
  for (size_t i = begin; i < end; ++i) range.push_back(i);
  return range;
}

TEST(JudgeFeatures, RejectsTooFewFeatures) {
  SfmEvidence evidence = Photographs(10);
  for (size_t i = 0; i < 5; ++i) evidence.num_features[i] = 40;
  EXPECT_OK(JudgeFeatures(evidence, {}));
  evidence.num_features[5] = 99;
  const absl::Status status = JudgeFeatures(evidence, {});
  EXPECT_STATUS(status, kRefused, "6 of 10 photographs show fewer than 100 features");
  EXPECT_STATUS(status, kRefused, "p0, p1, p2, p3, p4, ...");
  EXPECT_STATUS(status, kRefused, "blurred");
}

TEST(JudgeFeatures, NeedsThreePhotographsWhateverTheShare) {
  SfmEvidence evidence = Photographs(3);
  SfmOptions options;
  options.min_registered_share = 0;
  EXPECT_OK(JudgeFeatures(evidence, options));
  evidence.num_features[1] = 0;
  EXPECT_STATUS(JudgeFeatures(evidence, options), kRefused, "1 of 3");
}

TEST(JudgeModels, AcceptsALargestModelThatIsLargeEnough) {
  SfmEvidence evidence = Photographs(10);
  evidence.models = {Range(0, 5)};
  EXPECT_OK(JudgeModels(evidence, {}));
  evidence.models = {Range(0, 8), Range(8, 10), Range(2, 7)};  // few of its own
  EXPECT_OK(JudgeModels(evidence, {}));
}

TEST(JudgeModels, NamesBothPlaces) {
  SfmEvidence evidence = Photographs(16);
  evidence.models = {Range(0, 9), Range(9, 16)};
  const absl::Status status = JudgeModels(evidence, {});
  EXPECT_STATUS(status, kRefused, "9 of 16 show one (p0, p1, p2, p3, p4, ...)");
  EXPECT_STATUS(status, kRefused, "7 another (p9, p10, p11, p12, p13, ...)");
  EXPECT_STATUS(status, kRefused, "make a scene of each");
}

TEST(JudgeModels, DistinguishesNoMotionFromNoOverlap) {
  SfmEvidence evidence = Photographs(10);
  const absl::Status still = JudgeModels(evidence, {});
  EXPECT_STATUS(still, kRefused, "0 of 10 photographs, 5 are needed");
  EXPECT_STATUS(still, kRefused, "the camera did not move");
  evidence.num_connected = 3;
  const absl::Status apart = JudgeModels(evidence, {});
  EXPECT_STATUS(apart, kRefused,
                "p0, p1, p2, p3, p4, ... have too little in common with the others");
  EXPECT_THAT(std::string(apart.message()), Not(HasSubstr("did not move")));
  evidence.turns_on_the_spot = true;
  EXPECT_STATUS(JudgeModels(evidence, {}), kRefused, "the camera did not move");
}

TEST(JudgeModels, NamesPhotographsWithoutPoseByCause) {
  SfmEvidence evidence = Photographs(10);
  evidence.models = {Range(6, 10)};
  EXPECT_STATUS(
      JudgeModels(evidence, {}), kRefused,
      "4 of 10 photographs, 5 are needed: p0, p1, p2, p3, p4, ... have too little in common");
  for (const size_t i : {0, 1, 4}) evidence.num_features[i] = 600;
  evidence.num_features[3] = 740;
  evidence.num_partners = {0, 3, 0, 2, 0, 0, 5, 5, 5, 5};
  const absl::Status status = JudgeModels(evidence, {});
  EXPECT_STATUS(status, kRefused, "p0, p1, p3, p4 show fewer than 750 features: blurred");
  EXPECT_STATUS(status, kRefused, "; p2, p5 have nothing in common with the others");
  evidence.num_features[2] = 749;
  evidence.num_partners[5] = 1;
  EXPECT_STATUS(JudgeModels(evidence, {}), kRefused, "; p5 has too little in common");
}

TEST(DescribeUnplaced, NamesThemWhereEnoughOthersHaveAPose) {
  SfmEvidence evidence = Photographs(6);
  evidence.models = {Range(0, 6)};
  EXPECT_EQ(DescribeUnplaced(evidence), "");
  evidence.models = {{0, 1, 3, 4, 5}};
  evidence.num_partners = {4, 4, 0, 4, 4, 4};
  EXPECT_THAT(
      DescribeUnplaced(evidence),
      ::testing::StartsWith("no pose was found for 1 of 6 photographs: p2 has nothing in common"));
}

TEST(DescribeUnplaced, SaysSoIfNoTwoOverlap) {
  SfmEvidence evidence = Photographs(4);
  evidence.num_partners.assign(4, 0);
  EXPECT_THAT(DescribeUnplaced(evidence),
              HasSubstr("no two photographs (p0, p1, p2, p3) have enough in common"));
}

TEST(SfmOptions, NameTheOptionThatIsOutOfRange) {
  SfmOptions options;
  EXPECT_OK(Validate(options));
  options.max_video_frames = 2;
  EXPECT_STATUS(Validate(options), absl::StatusCode::kInvalidArgument,
                "max_video_frames is 2, must be in [3, 2000]");
  options = {};
  options.min_registered_share = 1.5;
  EXPECT_STATUS(Validate(options), absl::StatusCode::kInvalidArgument, "min_registered_share");
}

TEST(SfmVerdict, NamesPhotographsThatContradictTheMatches) {
  SfmEvidence evidence;
  evidence.names = {"a.jpg", "b.jpg", "c.jpg"};
  const std::string text = DescribeDisagreement(evidence, 80, 20, {1});
  EXPECT_THAT(text, ::testing::HasSubstr("contradict 20 %"));
  EXPECT_THAT(text, ::testing::HasSubstr("some photographs (b.jpg) may be misplaced"));
  EXPECT_THAT(DescribeDisagreement(evidence, 80, 20, {}),
              ::testing::HasSubstr("some photographs may be misplaced"));
}

}  // namespace
}  // namespace pepeseg
