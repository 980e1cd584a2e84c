#include "core/sfm/estimate_poses.h"

#include <algorithm>
#include <fstream>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "core/formats/colmap.h"
#include "tests/core/sfm/estimate_poses_fixture.h"
#include "tests/testing/textured_place.h"
#include "tests/testing/time_limit.h"

namespace pepeseg {
namespace {

constexpr auto kFailed = absl::StatusCode::kFailedPrecondition;

Eigen::Vector3d CenterOf(const Pose& cam_from_world) {
  return -(cam_from_world.rotation.conjugate() * cam_from_world.translation);
}

TEST_F(EstimatePosesTest, FindsTheCameraCentres) {
  const std::vector<View> views = testing::PhotographPlace(testing::PlaceArc(6), 1);
  for (const View& view : views) Add(view.photo);
  SfmOptions options;
  options.mapper = SfmEngine::kOwn;
  ASSERT_OK_AND_ASSIGN(const EstimatedPoses poses, Estimate(options));
  EXPECT_EQ(poses.num_registered, 6);
  EXPECT_LT(poses.reprojection_error, 1);
  EXPECT_EQ(poses.program, "pepeseg");
  EXPECT_THAT(warnings_, ::testing::IsEmpty());
  EXPECT_THAT(activities_, ::testing::ElementsAre("finding features in", "matching", "placing"));
  EXPECT_EQ(last_step_, 6);
  EXPECT_EQ(last_share_, 1);
  EXPECT_FALSE(std::filesystem::exists(places_.work));
  ASSERT_OK_AND_ASSIGN(const auto images, ReadColmapImages(poses.images, "images.bin"));
  std::vector<Eigen::Vector3d> estimated, truth;
  for (const ColmapImage& image : images) {
    size_t index = 0;
    while (index < files_.size() && files_[index].name != image.name) ++index;
    ASSERT_LT(index, files_.size()) << image.name;
    estimated.push_back(CenterOf(image.cam_from_world));
    truth.push_back(CenterOf(views[index].cam_from_world));
  }
  EXPECT_LT(testing::CenterError(estimated, truth), 0.01);
  ASSERT_OK_AND_ASSIGN(const EstimatedPoses again, ReadEstimatedPoses(places_.result));
  EXPECT_EQ(again.program, poses.program);
  std::filesystem::remove(places_.result / "manifest.json");
  EXPECT_STATUS(ReadEstimatedPoses(places_.result), absl::StatusCode::kNotFound, "manifest");
}

TEST_F(EstimatePosesTest, FindsTheSamePosesWithAnyNumberOfThreads) {
  for (const View& view : testing::PhotographPlace(testing::PlaceArc(5), 1)) Add(view.photo);
  std::string bytes[2];
  for (const int num_threads : {1, 2}) {
    last_share_ = 0;
    places_.num_threads = num_threads;
    SfmOptions options;
    options.mapper = SfmEngine::kOwn;
    ASSERT_OK_AND_ASSIGN(const EstimatedPoses poses, Estimate(options));
    std::ifstream file(poses.images, std::ios::binary);
    bytes[num_threads - 1].assign(std::istreambuf_iterator<char>(file), {});
  }
  EXPECT_FALSE(bytes[0].empty());
  EXPECT_EQ(bytes[0], bytes[1]);
  EXPECT_THAT(warnings_, ::testing::IsEmpty());
}

// The file of a photograph that COLMAP has copied vanishes before it is decoded.
TEST_F(EstimatePosesTest, FindsFeaturesByColmapIfTheOwnOnesFail) {
  for (const View& view : testing::PhotographPlace(testing::PlaceArc(6), 1)) Add(view.photo);
  std::filesystem::copy_file(files_[5].path, folder_ / "kept");
  places_.num_threads = 1;
  at_step_one_ = [&] { std::filesystem::remove(files_[5].path); };
  SfmOptions options;
  options.features = SfmEngine::kOwn;
  EXPECT_STATUS(Estimate(options), absl::StatusCode::kNotFound, "images/5.jpg");
  EXPECT_THAT(warnings_, ::testing::IsEmpty());
  std::filesystem::rename(folder_ / "kept", files_[5].path);
  activities_.clear();
  last_share_ = 0;
  ASSERT_OK_AND_ASSIGN(const EstimatedPoses poses, Estimate());
  EXPECT_EQ(poses.num_registered, 6);
  EXPECT_THAT(warnings_, ::testing::ElementsAre(::testing::HasSubstr("images/5.jpg")));
}

// A damaged photograph is for its owner to mend.
TEST_F(EstimatePosesTest, RejectsAPhotographThatDoesNotDecode) {
  for (const View& view : testing::PhotographPlace(testing::PlaceArc(3), 1)) Add(view.photo);
  std::fstream file(files_[1].path, std::ios::binary | std::ios::in | std::ios::out);
  const std::string bytes(std::istreambuf_iterator<char>(file), {});
  // The ids of the components in the header of the scan.
  file.seekp(static_cast<std::streamoff>(bytes.find("\xff\xda") + 5));
  file << '\x77';
  file.close();
  EXPECT_STATUS(Estimate(), absl::StatusCode::kInvalidArgument, "images/1.jpg: does not decode");
  EXPECT_THAT(warnings_, ::testing::IsEmpty());
}

TEST_F(EstimatePosesTest, FindsFeaturesAndMatchesByColmapOnRequest) {
  for (const View& view : testing::PhotographPlace(testing::PlaceArc(3), 1)) Add(view.photo);
  SfmOptions options;
  options.features = SfmEngine::kColmap;
  options.front = SfmEngine::kColmap;
  ASSERT_OK_AND_ASSIGN(const EstimatedPoses poses, Estimate(options));
  EXPECT_EQ(poses.num_registered, 3);
  EXPECT_THAT(poses.program, ::testing::StartsWith("COLMAP "));
  EXPECT_THAT(warnings_, ::testing::IsEmpty());
}

TEST_F(EstimatePosesTest, PlacesFewPhotographsByColmap) {
  for (const View& view : testing::PhotographPlace(testing::PlaceArc(4), 1)) Add(view.photo);
  ASSERT_OK_AND_ASSIGN(const EstimatedPoses poses, Estimate());
  EXPECT_EQ(poses.num_registered, 4);
  EXPECT_THAT(poses.program, ::testing::StartsWith("COLMAP "));
  EXPECT_THAT(warnings_, ::testing::IsEmpty());
}

// Two places: the own mapper leaves it to COLMAP to find the second one.
TEST_F(EstimatePosesTest, PlacesPhotographsByColmapIfTheOwnMapperRefuses) {
  for (const View& view : testing::PhotographPlace(testing::PlaceArc(17), 1)) Add(view.photo);
  for (const View& view : testing::PhotographPlace(testing::PlaceArc(3), 50)) Add(view.photo);
  ASSERT_OK_AND_ASSIGN(const EstimatedPoses poses, Estimate());
  EXPECT_EQ(poses.num_registered, 17);
  EXPECT_THAT(poses.program, ::testing::StartsWith("COLMAP "));
  EXPECT_THAT(warnings_, ::testing::Contains(
                             ::testing::HasSubstr("photographs that match others lack a pose")));
}

// COLMAP reads the database that pepeseg wrote.
TEST_F(EstimatePosesTest, MatchesOwnFeaturesByColmapOnRequest) {
  for (const View& view : testing::PhotographPlace(testing::PlaceArc(3), 1)) Add(view.photo);
  SfmOptions options;
  options.front = SfmEngine::kColmap;
  ASSERT_OK_AND_ASSIGN(const EstimatedPoses poses, Estimate(options));
  EXPECT_EQ(poses.num_registered, 3);
}

// The real COLMAP, after whose feature extraction the database says that it is of version 3.9.
TEST_F(EstimatePosesTest, MatchesByColmapIfTheOwnFrontCannotReadItsDatabase) {
  for (const View& view : testing::PhotographPlace(testing::PlaceArc(3), 1)) Add(view.photo);
  places_.program = folder_ / "newer";
  std::ofstream(places_.program)
      << "#!/bin/sh\ncolmap \"$@\" || exit 1\n"
         "if [ $1 = feature_extractor ]; then\n"
         "printf '\\017\\074' | dd of=$3 bs=1 seek=62 conv=notrunc 2>/dev/null\nfi\n";
  std::filesystem::permissions(places_.program, std::filesystem::perms::owner_all);
  SfmOptions options;
  options.features = SfmEngine::kColmap;
  options.front = SfmEngine::kOwn;
  EXPECT_STATUS(Estimate(options), kFailed, "of version 3900, not of COLMAP 3.8");
  EXPECT_THAT(warnings_, ::testing::IsEmpty());
  last_share_ = 0;
  activities_.clear();
  options.front = SfmEngine::kAuto;
  ASSERT_OK_AND_ASSIGN(const EstimatedPoses poses, Estimate(options));
  EXPECT_EQ(poses.num_registered, 3);
  EXPECT_THAT(warnings_, ::testing::ElementsAre(::testing::HasSubstr("of version 3900")));
}

TEST_F(EstimatePosesTest, StopsWhenProgressReturnsAnError) {
  for (const View& view : testing::PhotographPlace(testing::PlaceArc(4), 1)) Add(view.photo);
  cancel_at_ = 1;
  EXPECT_STATUS(Estimate(), absl::StatusCode::kCancelled, "enough");
  EXPECT_FALSE(std::filesystem::exists(places_.work));
  EXPECT_FALSE(std::filesystem::exists(places_.result));
}

// Runs a shell script in place of COLMAP, of a version for which pepeseg writes no databases.
class FakeColmapTest : public EstimatePosesTest {
 protected:
  void Write(const std::string& script) {
    places_.program = folder_ / "fake";
    std::ofstream(places_.program) << "#!/bin/sh\nif [ $1 = help ]; then echo 'COLMAP 9.9 -- x'; "
                                      "exit; fi\n"
                                   << script;
    std::filesystem::permissions(places_.program, std::filesystem::perms::owner_all);
    for (int i = 0; i < 3; ++i) Add({8, 8, 1, std::vector<uint8_t>(64, static_cast<uint8_t>(i))});
  }
};

TEST_F(FakeColmapTest, IsQuotedIfItFails) {
  Write("echo 'Processed file [1/3]'; echo 'out of luck' >&2; exit 4\n");
  SfmOptions options;
  options.features = SfmEngine::kColmap;
  EXPECT_STATUS(Estimate(options), absl::StatusCode::kInternal,
                "COLMAP's feature_extractor exited with code 4; its last words: Processed file "
                "[1/3] | out of luck");
  EXPECT_EQ(last_step_, 1);
}

TEST_F(FakeColmapTest, FindsTheFeaturesIfItIsOfAnotherVersion) {
  Write("exit 4\n");
  EXPECT_STATUS(Estimate(), absl::StatusCode::kInternal, "COLMAP's feature_extractor exited");
  EXPECT_THAT(warnings_, ::testing::ElementsAre(
                             ::testing::HasSubstr("databases of COLMAP 3.8, this is COLMAP 9.9")));
}

TEST_F(FakeColmapTest, IsStoppedAtTheTimeLimit) {
  Write("sleep 100\n");
  SfmOptions options;
  options.max_seconds = 1;
  const absl::Time start = absl::Now();
  EXPECT_STATUS(Estimate(options), absl::StatusCode::kDeadlineExceeded, "within 1 s");
  EXPECT_LT(absl::Now() - start, testing::TimeLimit(absl::Seconds(3)));
}

TEST_F(FakeColmapTest, IsReportedWithRemediesIfItIsMissing) {
  Write("");
  places_.program = folder_ / "nowhere";
  EXPECT_STATUS(Estimate(), kFailed, "install it (Debian's package colmap)");
  EXPECT_STATUS(Estimate(), kFailed, "or upload poses");
  places_.program = "true";  // prints nothing
  EXPECT_STATUS(Estimate(), kFailed, "does not report COLMAP's version");
}

}  // namespace
}  // namespace pepeseg
