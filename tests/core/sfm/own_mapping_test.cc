#include "core/sfm/own_mapping.h"

#include <Eigen/Geometry>
#include <fstream>

#include "absl/strings/str_cat.h"
#include "core/formats/colmap.h"
#include "core/formats/images.h"
#include "core/sfm/colmap_program.h"
#include "tests/core/sfm/compared_scene.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"
#include "tests/testing/textured_place.h"

namespace pepeseg {
namespace {

using testing::kNumPhotographs;

// The five photographs of CompareScene, each of one colour: red is 10 times the number, from 1.
class OwnMappingTest : public ::testing::Test {
 protected:
  OwnMappingTest() {
    // Cameras that do not turn determine no focal length.
    compared_.features.cameras[0].knows_focal = true;
    for (int i = 0; i < kNumPhotographs; ++i) {
      Image image{640, 480, 3, std::vector<uint8_t>(640 * 480 * 3, 200)};
      for (size_t k = 0; k < image.pixels.size(); k += 3) {
        image.pixels[k] = static_cast<uint8_t>(10 * (i + 1));
      }
      SfmPhotograph& photograph = photographs_.emplace_back();
      photograph.name = absl::StrCat(i, ".png");
      photograph.path = folder_ / photograph.name;
      std::ofstream(photograph.path, std::ios::binary) << EncodePng(image).value();
    }
  }

  absl::StatusOr<OwnMapping> Map() {
    return MapByOwnMapper({photographs_, compared_, folder_ / "model", 2},
                          [](double) { return absl::OkStatus(); });
  }
  std::vector<Eigen::Vector3d> Centres() {
    std::vector<Eigen::Vector3d> centres;
    const std::vector<ColmapImage> images =
        ReadColmapImages(folder_ / "model" / "images.bin", "images.bin").value();
    for (const ColmapImage& image : images) {
      const Pose& pose = image.cam_from_world;
      centres.push_back(-(pose.rotation.conjugate() * pose.translation));
    }
    return centres;
  }

  testing::TempFolder folder_;
  ComparedDatabase compared_ = testing::CompareScene();
  std::vector<SfmPhotograph> photographs_;
};

std::vector<Eigen::Vector3d> TrueCentres() {
  std::vector<Eigen::Vector3d> centres;
  for (int i = 0; i < kNumPhotographs; ++i) centres.emplace_back(0.4 * i, 0.05 * i, 0);
  return centres;
}

TEST_F(OwnMappingTest, WritesAModelWithTheTruePoses) {
  ASSERT_OK_AND_ASSIGN(const OwnMapping mapping, Map());
  EXPECT_EQ(mapping.refusal, "");
  ASSERT_EQ(mapping.mapped.models.size(), 1u);
  const SfmModel& model = mapping.mapped.models.front();
  EXPECT_THAT(model.names, ::testing::ElementsAre("c1/000001.jpg", "c1/000002.jpg", "c1/000003.jpg",
                                                  "c1/000004.jpg", "c1/000005.jpg"));
  EXPECT_LT(model.reprojection_error, 0.01);
  EXPECT_TRUE(mapping.mapped.agreement.IsPlausible());
  EXPECT_GT(mapping.mapped.agreement.agreeing, 1900);
  EXPECT_LT(testing::CenterError(Centres(), TrueCentres()), 1e-3);
  ASSERT_OK_AND_ASSIGN(const ColmapCameras cameras,
                       ReadColmapCameras(folder_ / "model" / "cameras.bin", "cameras.bin"));
  EXPECT_NEAR(cameras.by_id.at(1).fx, 500, 5);
  EXPECT_NEAR(cameras.by_id.at(1).distortion[0], 0.05, 0.01);
}

// The mapper works at the size at which features were found.
TEST_F(OwnMappingTest, WritesLensesOfTheStoredPhotographs) {
  compared_.feature_side = 320;
  ASSERT_OK_AND_ASSIGN(const OwnMapping mapping, Map());
  EXPECT_EQ(mapping.refusal, "");
  EXPECT_LT(mapping.mapped.models.front().reprojection_error, 0.01);
  EXPECT_LT(testing::CenterError(Centres(), TrueCentres()), 1e-3);
  ASSERT_OK_AND_ASSIGN(const ColmapCameras cameras,
                       ReadColmapCameras(folder_ / "model" / "cameras.bin", "cameras.bin"));
  EXPECT_EQ(cameras.by_id.at(1).width, 640);
  EXPECT_NEAR(cameras.by_id.at(1).fx, 500, 5);
}

TEST_F(OwnMappingTest, GivesPointsTheMeanColourOfTheirPixels) {
  ASSERT_OK(Map());
  ASSERT_OK_AND_ASSIGN(const std::vector<ScenePoint> points,
                       ReadColmapPoints(folder_ / "model" / "points3D.bin", "points3D.bin"));
  ASSERT_GT(points.size(), 190u);
  // Most points are in all five photographs: 10, 20, 30, 40 and 50.
  size_t num_in_all = 0;
  for (const ScenePoint& point : points) {
    num_in_all += point.rgb[0] == 30;
    EXPECT_EQ(point.rgb[1], 200);
    EXPECT_EQ(point.rgb[2], 200);
  }
  EXPECT_GT(num_in_all, points.size() * 9 / 10);
}

// COLMAP reads the model, and finds features with points and tracks that name each other.
TEST_F(OwnMappingTest, WritesWhatColmapReads) {
  ASSERT_OK(Map());
  ASSERT_OK_AND_ASSIGN(const ColmapProgram program, ColmapProgram::Open("colmap", folder_ / "log"));
  std::string printed;
  ASSERT_OK(program.Run({"model_analyzer", {"--path", (folder_ / "model").string()}, ""},
                        absl::InfiniteFuture(), [&](std::span<const std::string> lines) {
                          for (const std::string& line : lines)
                            absl::StrAppend(&printed, line, "\n");
                          return absl::OkStatus();
                        }));
  EXPECT_THAT(printed, ::testing::HasSubstr("Registered images: 5"));
  EXPECT_THAT(printed, ::testing::HasSubstr("Mean track length: 5.0"));
  EXPECT_THAT(printed, ::testing::HasSubstr("Mean observations per image: 200.0"));
}

TEST_F(OwnMappingTest, RefusesAModelThatTheGatesRefuse) {
  compared_.pairs.resize(1);
  ASSERT_OK_AND_ASSIGN(const OwnMapping mapping, Map());
  EXPECT_EQ(mapping.refusal, "the mapper refused its model: too few connected photographs");
  EXPECT_TRUE(mapping.mapped.models.empty());
}

TEST_F(OwnMappingTest, ReturnsTheErrorOfAPhotographWithoutPixels) {
  std::filesystem::remove(photographs_[2].path);
  EXPECT_STATUS(Map(), absl::StatusCode::kNotFound, "2.png");
}

}  // namespace
}  // namespace pepeseg
