#include "core/sfm/sfm_model.h"

#include <fstream>

#include "core/formats/colmap.h"
#include "tests/testing/colmap_files.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

using ::testing::ElementsAre;

class SfmModelTest : public ::testing::Test {
 protected:
  void Write(const std::string& name, const std::string& bytes) const {
    std::filesystem::create_directories((folder_ / name).parent_path());
    std::ofstream(folder_ / name, std::ios::binary) << bytes;
  }
  void WriteModel(const std::string& name, const std::vector<std::string>& photographs) const {
    std::vector<testing::ImageRecord> images;
    for (const std::string& photograph : photographs) {
      testing::ImageRecord image;
      image.id = static_cast<uint32_t>(images.size() + 1);
      image.name = photograph;
      image.num_points = 3;
      images.push_back(image);
    }
    Write(name + "/images.bin", testing::ImagesBinary(images));
    testing::CameraRecord camera;
    camera.width = 40;
    camera.height = 30;
    camera.parameters = {50, 50, 20, 15};
    Write(name + "/cameras.bin", testing::CamerasBinary({camera}));
    testing::PointRecord point;
    point.track_length = 2;
    Write(name + "/points3D.bin", testing::PointsBinary({point}));
  }

  testing::TempFolder folder_;
};

TEST_F(SfmModelTest, SortsTheLargestFirst) {
  WriteModel("0", {"c1/000002.jpg", "c1/000001.jpg"});
  WriteModel("1", {"c1/000003.jpg", "c1/000005.jpg", "c1/000004.jpg"});
  std::filesystem::create_directories(folder_ / "2");  // without a model
  ASSERT_OK_AND_ASSIGN(const auto models, ReadSfmModels(folder_.path()));
  ASSERT_EQ(models.size(), 2u);
  EXPECT_THAT(models[0].names, ElementsAre("c1/000003.jpg", "c1/000004.jpg", "c1/000005.jpg"));
  EXPECT_THAT(models[1].names, ElementsAre("c1/000001.jpg", "c1/000002.jpg"));
}

TEST_F(SfmModelTest, CopiesWithTheOwnersNames) {
  WriteModel("0", {"c1/000001.jpg", "c2/000002.png"});
  std::filesystem::create_directories(folder_ / "copy");
  ASSERT_OK_AND_ASSIGN(const SfmModel model, ReadSfmModel(folder_ / "0"));
  ASSERT_OK(CopyRenamed(
      model, {{"c1/000001.jpg", "images/a long name.jpg"}, {"c2/000002.png", "images/b.png"}},
      folder_ / "copy"));
  ASSERT_OK_AND_ASSIGN(const auto images,
                       ReadColmapImages(folder_ / "copy/images.bin", "images.bin"));
  ASSERT_EQ(images.size(), 2u);
  EXPECT_EQ(images[0].name, "images/a long name.jpg");
  EXPECT_EQ(images[1].name, "images/b.png");
  ASSERT_OK(ReadColmapCameras(folder_ / "copy/cameras.bin", "cameras.bin"));
  ASSERT_OK(ReadColmapPoints(folder_ / "copy/points3D.bin", "points3D.bin"));
  EXPECT_STATUS(CopyRenamed(model, {}, folder_ / "copy"), absl::StatusCode::kDataLoss, "images");
}

TEST_F(SfmModelTest, RejectsFilesCutShortAtAnyByte) {
  WriteModel("0", {"c1/000001.jpg", "c1/000002.jpg"});
  const std::filesystem::path path = folder_ / "0/images.bin";
  for (auto size = std::filesystem::file_size(path) - 1; size > 0; --size) {
    std::filesystem::resize_file(path, size);
    EXPECT_STATUS(ReadSfmModel(folder_ / "0"), absl::StatusCode::kDataLoss, "images.bin");
  }
}

}  // namespace
}  // namespace pepeseg
