#include "tests/core/sfm/estimate_poses_fixture.h"
#include "tests/testing/textured_place.h"

// Captures whose poses cannot be estimated, or not all: photographs are named, with the reason.
namespace pepeseg {
namespace {

constexpr auto kFailed = absl::StatusCode::kFailedPrecondition;
using FailedCaptures = EstimatePosesTest;

TEST_F(FailedCaptures, RejectsBlurredPhotographs) {
  for (const View& view : testing::PhotographPlace(testing::PlaceArc(3), 1)) {
    Add(testing::Blurred(view.photo, 20));
  }
  EXPECT_STATUS(Estimate(), kFailed, "3 of 3 photographs show fewer than 100 features");
}

TEST_F(FailedCaptures, RejectsTwoPlaces) {
  for (const uint32_t seed : {1u, 50u}) {
    for (const View& view : testing::PhotographPlace(testing::PlaceArc(4), seed)) Add(view.photo);
  }
  EXPECT_STATUS(Estimate(), kFailed, "places that have nothing in common: 4 of 8 show one");
}

TEST_F(FailedCaptures, FailIfOnlyTheOwnMapperMayPlaceThem) {
  for (const uint32_t seed : {1u, 50u}) {
    for (const View& view : testing::PhotographPlace(testing::PlaceArc(3), seed)) Add(view.photo);
  }
  SfmOptions options;
  options.mapper = SfmEngine::kOwn;
  EXPECT_STATUS(Estimate(options), kFailed, "leave sfm.mapper unset");
  EXPECT_THAT(warnings_, ::testing::IsEmpty());
}

TEST_F(FailedCaptures, NamesTwoPhotographs) {
  for (const View& view : testing::PhotographPlace(testing::PlaceArc(2), 1)) Add(view.photo);
  EXPECT_STATUS(Estimate(), kFailed,
                "2 photographs (images/0.jpg, images/1.jpg): poses are estimated from at least 3");
}

TEST_F(FailedCaptures, NamesPhotographsThatDoNotOverlap) {
  for (uint32_t place = 0; place < 4; ++place) {
    Add(testing::PhotographPlace(testing::PlaceArc(1), 1 + 50 * place).front().photo);
  }
  EXPECT_STATUS(Estimate(), kFailed,
                "no two photographs (images/0.jpg, images/1.jpg, images/2.jpg, images/3.jpg) have "
                "enough in common");
}

TEST_F(FailedCaptures, NamesATurnOnTheSpot) {
  for (const View& view : testing::PhotographPlace(testing::PlaceTurn(4), 1)) Add(view.photo);
  EXPECT_STATUS(Estimate(), kFailed,
                "only turned on the spot (images/0.jpg, images/1.jpg, images/2.jpg, images/3.jpg); "
                "walk around the scene");
}

TEST_F(FailedCaptures, NamesABlurredPhotograph) {
  const std::vector<View> views = testing::PhotographPlace(testing::PlaceArc(5), 1);
  for (const View& view : views) {
    Add(files_.size() == 2 ? testing::Blurred(view.photo, 10) : view.photo);
  }
  ASSERT_OK_AND_ASSIGN(const EstimatedPoses poses, Estimate());
  EXPECT_EQ(poses.num_registered, 4);
  ASSERT_EQ(warnings_.size(), 1u);
  EXPECT_THAT(warnings_[0], ::testing::MatchesRegex(
                                "no pose was found for 1 of 5 photographs: images/2.jpg shows "
                                "fewer than [0-9]+ features: blurred, dark.*"));
}

TEST_F(FailedCaptures, NamesAPhotographThatBelongsElsewhere) {
  for (const View& view : testing::PhotographPlace(testing::PlaceArc(4), 1)) Add(view.photo);
  Add(testing::PhotographPlace(testing::PlaceArc(1), 99).front().photo);
  ASSERT_OK_AND_ASSIGN(const EstimatedPoses poses, Estimate());
  EXPECT_EQ(poses.num_registered, 4);
  EXPECT_THAT(warnings_, ::testing::ElementsAre(::testing::HasSubstr(
                             "1 of 5 photographs: images/4.jpg has nothing in common with the "
                             "others: another place")));
}

TEST_F(FailedCaptures, RejectsACameraThatDoesNotMove) {
  const View view = testing::PhotographPlace(testing::PlaceArc(1), 1).front();
  for (int i = 0; i < 4; ++i) {
    Image photo = view.photo;
    // Makes the files different.
    std::fill_n(photo.pixels.begin(), 60, static_cast<uint8_t>(60 * i));
    Add(photo);
  }
  EXPECT_STATUS(Estimate(), kFailed, "the camera did not move");
}

}  // namespace
}  // namespace pepeseg
