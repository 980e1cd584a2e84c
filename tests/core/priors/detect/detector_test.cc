#include "core/priors/detect/detector.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "tests/testing/fake_sam.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing::MakeFakeDetector;
using testing::ReplaceSamFile;

struct DetectorTest : ::testing::Test {
  DetectorTest() { MakeFakeDetector(detector); }
  std::string Error() {
    const absl::Status status = Detector::Load(detector, {}).status();
    EXPECT_TRUE(absl::IsFailedPrecondition(status)) << status;
    return std::string(status.message());
  }

  testing::TempFolder folder;
  const std::filesystem::path detector = folder / "detector";
};

struct Rectangle {
  int x = 0, y = 0, width = 0, height = 0;
};

// A grey photograph with a red rectangle.
Image RedRectangle(int width, int height, const Rectangle& red) {
  Image photo = {width, height, 3, std::vector<uint8_t>(size_t{3} * width * height, 120)};
  for (int y = red.y; y < red.y + red.height; ++y) {
    for (int x = red.x; x < red.x + red.width; ++x) {
      uint8_t* pixel = &photo.pixels[(size_t{3} * y * width) + size_t{3} * x];
      pixel[0] = 250;
      pixel[1] = pixel[2] = 10;
    }
  }
  return photo;
}

TEST_F(DetectorTest, FindsBoxesInPixelsOfThePhotograph) {
  ASSERT_OK_AND_ASSIGN(const auto found, Detector::Load(detector, {}));
  EXPECT_THAT(found->words(), ElementsAre("apple", "ball"));
  // Wide, tall, and larger than the network's frame.
  for (const auto& [width, height] : {std::pair{300, 200}, {200, 300}, {1000, 700}}) {
    ASSERT_OK_AND_ASSIGN(const auto boxes,
                         found->Detect(RedRectangle(width, height, {60, 40, 100, 80})));
    ASSERT_EQ(boxes.size(), 1);
    EXPECT_EQ(boxes[0].word, 0);
    EXPECT_FLOAT_EQ(boxes[0].score, 0.8F);
    const double pixel = std::max(1.0, width / 256.0);
    EXPECT_NEAR(boxes[0].x0, 60, pixel);
    EXPECT_NEAR(boxes[0].y0, 40, pixel);
    EXPECT_NEAR(boxes[0].x1, 160, pixel);
    EXPECT_NEAR(boxes[0].y1, 120, pixel);
  }
}

TEST_F(DetectorTest, FindsNothingWhereNothingIs) {
  ASSERT_OK_AND_ASSIGN(const auto found, Detector::Load(detector, {}));
  ASSERT_OK_AND_ASSIGN(const auto boxes, found->Detect(RedRectangle(64, 64, {})));
  EXPECT_TRUE(boxes.empty());
}

// The fake finds the red pixels of each tile. Those that the tile cuts off are not reported again.
TEST_F(DetectorTest, ReportsAThingOfSeveralTilesOnce) {
  ASSERT_OK_AND_ASSIGN(const auto found, Detector::Load(detector, {.tiles = 2}));
  for (const Rectangle red : {Rectangle{20, 20, 60, 60}, {120, 20, 60, 60}, {80, 80, 140, 140}}) {
    ASSERT_OK_AND_ASSIGN(const auto boxes, found->Detect(RedRectangle(300, 300, red)));
    ASSERT_EQ(boxes.size(), 1) << red.x;
    EXPECT_NEAR(boxes[0].x0, red.x, 2);
    EXPECT_NEAR(boxes[0].y1, red.y + red.height, 2);
  }
}

TEST_F(DetectorTest, RefusesFilesThatAreNotThoseInstalled) {
  EXPECT_OK(CheckDetectorFiles(detector));
  EXPECT_TRUE(absl::IsNotFound(CheckDetectorFiles(folder / "none")));
  std::ofstream(detector / "words.txt", std::ios::app) << "pear\n";
  EXPECT_THAT(Error(), HasSubstr("words.txt: its SHA-256 is "));
  EXPECT_THAT(Error(), HasSubstr("run deploy/detector.sh " + detector.string()));
}

TEST_F(DetectorTest, RefusesWordsThatRepeatOrAreMissing) {
  for (const char* words : {"", "apple\nApple\n", " \n"}) {
    ReplaceSamFile(detector, "words.txt", words);
    EXPECT_THAT(Error(), HasSubstr("different words, one a line"));
  }
}

TEST_F(DetectorTest, RefusesANetworkThatOnnxRuntimeCannotRead) {
  ReplaceSamFile(detector, "detector.onnx", "no network");
  EXPECT_THAT(Error(), HasSubstr("Protobuf parsing failed"));
}

TEST_F(DetectorTest, RefusesANetworkOfOtherOutputs) {
  ReplaceSamFile(detector, "words.txt", "apple\nball\npear\n");
  ASSERT_OK_AND_ASSIGN(const auto found, Detector::Load(detector, {}));
  const absl::Status status = found->Detect(RedRectangle(64, 64, {})).status();
  EXPECT_TRUE(absl::IsFailedPrecondition(status)) << status;
  EXPECT_THAT(std::string(status.message()), HasSubstr("an output has another shape"));
}

}  // namespace
}  // namespace pepeseg
