#include "core/sfm/starting_cameras.h"

#include <algorithm>
#include <fstream>

#include "core/formats/exif.h"
#include "core/formats/images.h"
#include "core/sfm/find_features.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

// Appends little-endian numbers.
void Add(std::string& bytes, uint32_t value, int num_bytes) {
  for (int i = 0; i < num_bytes; ++i) bytes += static_cast<char>(value >> (8 * i));
}

// A TIFF structure with maker, model, and focal lengths where they are not 0.
std::string Exif(const std::string& maker, const std::string& model, int focal_length,
                 int focal_length_35_mm) {
  const auto entry = [](std::string& to, uint32_t tag, uint32_t type, uint32_t count,
                        uint32_t value) {
    Add(to, tag, 2), Add(to, type, 2), Add(to, count, 4), Add(to, value, 4);
  };
  constexpr uint32_t kMain = 8, kMainEnd = kMain + 2 + 3 * 12 + 4;
  const int count = (focal_length != 0) + (focal_length_35_mm != 0);
  const auto after = static_cast<uint32_t>(kMainEnd + 2 + count * 12 + 4);
  std::string tiff = "II*", values;
  tiff += '\0';
  Add(tiff, kMain, 4);
  Add(tiff, 3, 2);
  entry(tiff, 0x010f, 2, 32, after);
  entry(tiff, 0x0110, 2, 32, after + 32);
  entry(tiff, 0x8769, 4, 1, kMainEnd);
  Add(tiff, 0, 4);
  Add(tiff, static_cast<uint32_t>(count), 2);
  if (focal_length != 0) entry(tiff, 0x920a, 5, 1, after + 64);
  if (focal_length_35_mm != 0) {
    entry(tiff, 0xa405, 3, 1, static_cast<uint32_t>(focal_length_35_mm));
  }
  Add(tiff, 0, 4);
  for (std::string text : {maker, model}) {
    text.resize(32);
    values += text;
  }
  Add(values, static_cast<uint32_t>(focal_length), 4);
  Add(values, 1, 4);
  return tiff + values;
}

class StartingCamerasTest : public ::testing::Test {
 protected:
  void AddPhotograph(int width, int height, const std::string& exif) {
    const Image grey{width, height, 1,
                     std::vector<uint8_t>(static_cast<size_t>(width) * height,
                                          static_cast<uint8_t>(files_.size()))};
    std::string jpeg = EncodeJpeg(grey, 90).value();
    if (!exif.empty()) jpeg = WithUprightExif(jpeg, exif);
    const std::string name = std::to_string(files_.size());
    std::ofstream(folder_ / name, std::ios::binary) << jpeg;
    files_.push_back({FileKind::kImage, "images/" + name + ".jpg", folder_ / name});
  }

  testing::TempFolder folder_;
  std::vector<DatasetFile> files_;
};

// The real COLMAP extracts features, and makes the cameras that are expected.
TEST_F(StartingCamerasTest, AreThoseOfColmap) {
  AddPhotograph(64, 48, "");
  AddPhotograph(48, 64, "");
  AddPhotograph(64, 48, Exif("Apple", "iPhone 7", 4, 28));
  AddPhotograph(64, 48, "");
  AddPhotograph(64, 48, Exif("Canon", "Canon DIGITAL IXUS 100 IS", 6, 0));
  AddPhotograph(64, 48, Exif("Nobody", "Unknown", 6, 0));
  ASSERT_OK_AND_ASSIGN(const auto photographs, ReadSfmPhotographs(files_));
  const std::vector<std::string> names = SafeNames(photographs);
  ASSERT_OK(LayOut(photographs, folder_ / "laid", folder_ / "masks"));
  ASSERT_OK_AND_ASSIGN(const ColmapProgram colmap, ColmapProgram::Open("colmap", folder_ / "log"));
  SfmWatch watch({.num_photographs = 6}, {}, [](const StepReport&) { return absl::OkStatus(); });
  const FeatureTask task{
      photographs, names, folder_ / "laid", "", folder_ / "sensors", folder_ / "theirs.db", 128, 1};
  ASSERT_OK(FindFeaturesByColmap(task, colmap, watch));
  ASSERT_OK_AND_ASSIGN(const DatabaseFeatures theirs, ReadDatabaseFeatures(task.database));

  std::vector<DatabaseCamera> cameras = StartingCameras(photographs);
  ASSERT_EQ(cameras.size(), 5u);
  ASSERT_OK(LookUpSensors(photographs, task.images, task.sensors, colmap, watch, cameras));
  const std::vector<size_t> of = CameraIndices(photographs);
  ASSERT_EQ(theirs.images.size(), 6u);
  for (const DatabaseImage& image : theirs.images) {
    const auto index = std::find(names.begin(), names.end(), image.name) - names.begin();
    const DatabaseCamera &own = cameras[of[index]], &expected = theirs.cameras[image.camera];
    EXPECT_EQ(own.model, expected.model) << image.name;
    EXPECT_EQ(own.width, expected.width) << image.name;
    EXPECT_EQ(own.height, expected.height) << image.name;
    EXPECT_EQ(own.params, expected.params) << image.name;
    EXPECT_EQ(own.knows_focal, expected.knows_focal) << image.name;
  }
  EXPECT_TRUE(cameras[2].knows_focal) << "28 mm";
  EXPECT_TRUE(cameras[3].knows_focal) << "COLMAP knows the sensor";
  EXPECT_FALSE(cameras[4].knows_focal);
}

TEST_F(StartingCamerasTest, DoNotAskColmapWithoutNeed) {
  AddPhotograph(64, 48, Exif("Apple", "iPhone 7", 4, 28));
  AddPhotograph(64, 48, "");
  ASSERT_OK_AND_ASSIGN(const auto photographs, ReadSfmPhotographs(files_));
  ASSERT_OK_AND_ASSIGN(const ColmapProgram colmap, ColmapProgram::Open("colmap", folder_ / "log"));
  SfmWatch watch({.num_photographs = 2}, {}, [](const StepReport&) { return absl::OkStatus(); });
  std::vector<DatabaseCamera> cameras = StartingCameras(photographs);
  EXPECT_OK(LookUpSensors(photographs, "nowhere", "nowhere", colmap, watch, cameras));
  EXPECT_FALSE(std::filesystem::exists("nowhere"));
}

}  // namespace
}  // namespace pepeseg
