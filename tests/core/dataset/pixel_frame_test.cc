#include "core/dataset/pixel_frame.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>

#include "core/dataset/import.h"
#include "core/formats/images.h"
#include "tests/testing/small_dataset.h"
#include "tests/testing/status_testing.h"

// Photographs with an EXIF orientation whose cameras, masks, ignore masks and depth are of the
// stored or of the upright pixels.
namespace pepeseg {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using testing::Jpeg;
using testing::Png;
using testing::WriteBytes;

// Returns the JPEG with an APP1 segment of one TIFF entry: the orientation.
std::string WithOrientation(std::string jpeg, int orientation) {
  std::string exif(
      "\xff\xe1\0\x22"
      "Exif\0\0MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0",
      36);
  exif[29] = static_cast<char>(orientation);
  return jpeg.insert(2, exif);
}

// A picture of blocks of one colour each, in the pixels of its camera, which is upright or not.
struct BlockScene : testing::SmallDataset {
  // `orientation` is that of all photographs. The frames are those of the files.
  struct Frames {
    int orientation = 1;
    PixelFrame cameras = PixelFrame::kStored, companions = PixelFrame::kStored;
    int width = 96, height = 72;
    bool coloured_points = true;
    bool floor = false;  // depth grows evenly from the top to the bottom
  };

  explicit BlockScene(const Frames& frames) : frames_(frames) {
    images = {{1, {1, 0, 0, 0}, {0, 0, 0.1}, 1, "a.jpg"}, {2, {1, 0, 0, 0}, {0, 0, 0}, 1, "b.jpg"}};
    cameras = {{1,
                1,
                "PINHOLE",
                static_cast<uint64_t>(frames.width),
                static_cast<uint64_t>(frames.height),
                {80, 80, frames.width / 2.0, frames.height / 2.0}}};
    Paint();
    AddPoints();
    const int orientation = frames.orientation;
    const bool camera_is_stored = frames.cameras == PixelFrame::kStored;
    const auto stored = [&](const Image& image) {
      return camera_is_stored ? image : Upright(image, InverseOrientation(orientation));
    };
    const auto in_companion = [&](const Image& image) {
      if (frames.companions == PixelFrame::kStored) return stored(image);
      return Upright(stored(image), orientation);
    };
    for (const char* stem : {"a", "b"}) {
      const std::string name(stem);
      WriteBytes(folder / ("images/" + name + ".jpg"),
                 WithOrientation(Jpeg(stored(picture)), orientation));
      WriteBytes(folder / ("masks/" + name + ".png"), Png(in_companion(labels)));
      WriteBytes(folder / ("depth/" + name + ".png"),
                 Png(in_companion(frames.floor ? Floor() : labels)));
      WriteBytes(folder / ("ignore/" + name + ".png"), Png(in_companion(first)));
    }
    Write();
    for (const char* name : {"masks/a.json", "ignore_mask.png", "images/sub/c.png"}) {
      std::filesystem::remove(folder / name);
    }
  }

  // Fills picture, labels (1 and up) and `first`, which is the first block.
  void Paint() {
    const int width = frames_.width, height = frames_.height;
    picture = {width, height, 3, {}};
    labels = first = {width, height, 1, {}};
    std::mt19937 random(7);
    std::vector<std::array<uint8_t, 3>> colours(64);
    for (auto& colour : colours) {
      for (uint8_t& value : colour) value = static_cast<uint8_t>(random() % 256);
    }
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        // Columns and rows of unequal widths, so that no turn maps blocks to blocks.
        const int column = (x * x / width + x) * 5 / (2 * width),
                  row = (y + y * y / height) * 2 / height;
        const int block = row * 5 + column;
        for (const uint8_t value : colours[static_cast<size_t>(block)]) {
          picture.pixels.push_back(value);
        }
        labels.pixels.push_back(static_cast<uint8_t>(block + 1));
        first.pixels.push_back(block == 0 ? 255 : 0);
      }
    }
  }

  static int FloorDepth(int y) { return 40 + 2 * y; }

  Image Floor() const {
    Image floor{frames_.width, frames_.height, 1, {}};
    for (int i = 0; i < frames_.width * frames_.height; ++i) {
      floor.pixels.push_back(static_cast<uint8_t>(FloorDepth(i / frames_.width)));
    }
    return floor;
  }

  // Adds points of the picture's colours at the depth 4 of camera b, or at that of the floor.
  void AddPoints() {
    points.clear();
    for (int i = 0; i < 600; ++i) {
      const int x = i * 37 % frames_.width, y = i * 53 % frames_.height;
      testing::PointRecord point{static_cast<uint64_t>(i + 1)};
      const double depth = frames_.floor ? 0.04 * FloorDepth(y) : 4;
      point.xyz[0] = (x + 0.5 - frames_.width / 2.0) / 80 * depth;
      point.xyz[1] = (y + 0.5 - frames_.height / 2.0) / 80 * depth;
      point.xyz[2] = depth;
      for (size_t c = 0; c < 3; ++c) {
        point.rgb[c] = frames_.coloured_points
                           ? picture.pixels[3 * static_cast<size_t>(y * frames_.width + x) + c]
                           : 0;
      }
      points.push_back(point);
    }
  }

  // Returns the share of the pixels of the view where photograph, masks, ignore mask and depth are
  // those of the camera's picture.
  double Agreement(const View& view) const {
    if (view.camera.width != picture.width || view.camera.height != picture.height) return 0;
    double num_same = 0;
    for (int y = 0; y < picture.height; ++y) {
      for (int x = 0; x < picture.width; ++x) {
        const size_t i = static_cast<size_t>(y) * picture.width + x;
        const int label = labels.pixels[i];
        bool same = std::abs(view.photo.pixels[3 * i] - picture.pixels[3 * i]) < 40;
        same &= view.masks.Covers(label - 1, x, y);
        same &= (view.ignore[i] != 0) == (label == 1);
        // Depth grows with the label; the first block is ignored.
        same &= label == 1 ? std::isnan(view.depth.values[i])
                           : std::abs(view.depth.values[i] - (label - 2) / 18.0F) < 0.01F;
        num_same += same;
      }
    }
    return num_same / static_cast<double>(picture.width * picture.height);
  }

  Frames frames_;
  Image picture, labels, first;
};

TEST(PixelFrames, OfCamerasAndCompanionsAreFoundForEachOrientation) {
  for (const auto& [width, height] : {std::pair(96, 72), std::pair(80, 80)}) {
    for (int orientation = 1; orientation <= 8; ++orientation) {
      for (const PixelFrame cameras : {PixelFrame::kStored, PixelFrame::kUpright}) {
        for (const PixelFrame companions : {PixelFrame::kStored, PixelFrame::kUpright}) {
          SCOPED_TRACE(absl::StrCat(width, "x", height, ", orientation ", orientation, ", cameras ",
                                    NameOf(cameras), ", companions ", NameOf(companions)));
          const BlockScene scene({orientation, cameras, companions, width, height});
          ASSERT_OK_AND_ASSIGN(const Capture capture, scene.Import());
          ASSERT_EQ(capture.views.size(), 2u);
          EXPECT_GT(scene.Agreement(capture.views[1]), 0.9);
          const int want = cameras == PixelFrame::kStored ? orientation : 1;
          EXPECT_EQ(capture.views[0].photograph->orientation, want);
          if (orientation == 1) continue;
          EXPECT_THAT(capture.warnings,
                      Contains(HasSubstr(absl::StrCat("mask files of photographs with an EXIF "
                                                      "orientation are of ",
                                                      NameOf(companions), " pixels"))));
        }
      }
    }
  }
}

// Turned round, the depth of a floor correlates with the points as disparity does.
TEST(PixelFrames, OfTheDepthOfAFloorAreFound) {
  for (const int orientation : {3, 4}) {
    for (const PixelFrame cameras : {PixelFrame::kStored, PixelFrame::kUpright}) {
      for (const PixelFrame companions : {PixelFrame::kStored, PixelFrame::kUpright}) {
        SCOPED_TRACE(absl::StrCat("orientation ", orientation, ", cameras ", NameOf(cameras),
                                  ", companions ", NameOf(companions)));
        BlockScene::Frames frames = {orientation, cameras, companions};
        frames.floor = true;
        const BlockScene scene(frames);
        ASSERT_OK_AND_ASSIGN(const Capture capture, scene.Import());
        const View& view = capture.views[1];
        EXPECT_EQ(view.depth.kind, DepthPrior::Kind::kDepth);
        EXPECT_NEAR(view.depth.values[95], 0, 0.05);  // right, at the top
        EXPECT_NEAR(view.depth.values[96 * 72 - 1], 1, 0.05);
      }
    }
  }
}

TEST(PixelFrames, OfCompanionsAreRefusedIfTheirBordersFitNeither) {
  BlockScene scene({.orientation = 3});
  Image flat = scene.picture;
  std::fill(flat.pixels.begin(), flat.pixels.end(), 90);
  for (const char* name : {"images/a.jpg", "images/b.jpg"}) {
    WriteBytes(scene.folder / name, WithOrientation(Jpeg(flat), 3));
  }
  EXPECT_STATUS(scene.Import(), absl::StatusCode::kInvalidArgument,
                "masks/a.png: its borders fit the stored and the upright pixels of images/a.jpg, "
                "which has the EXIF orientation 3");
}

TEST(PixelFrames, OfColmapCamerasAreStoredWithoutColouredPoints) {
  const BlockScene scene({.orientation = 3, .coloured_points = false});
  ASSERT_OK_AND_ASSIGN(const Capture capture, scene.Import());
  EXPECT_THAT(capture.warnings, Contains(HasSubstr("which COLMAP reads")));
  EXPECT_GT(scene.Agreement(capture.views[1]), 0.9);
}

// Real masks: 15 photographs of a shelf, in which the masks' borders need not be edges.
TEST(PixelFrames, OfRealMasksAreFound) {
  for (const PixelFrame masks : {PixelFrame::kStored, PixelFrame::kUpright}) {
    for (const int orientation : {2, 3, 4}) {
      const testing::TempFolder folder;
      ASSERT_OK_AND_ASSIGN(std::vector<DatasetFile> files,
                           ListDataset(PEPESEG_TEST_DATA "/apc_shelf"));
      for (DatasetFile& file : files) {
        if (file.kind != FileKind::kImage) continue;
        const std::string bytes = testing::ReadBytes(file.path);
        file.path = folder / ("photo" + std::to_string(&file - files.data()));
        std::string stored = bytes;
        if (masks == PixelFrame::kUpright) {
          ASSERT_OK_AND_ASSIGN(
              const Image image,
              DecodePhoto({reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size()}, "photo"));
          stored = Jpeg(Upright(image, orientation));  // its own inverse
        }
        WriteBytes(file.path, WithOrientation(stored, orientation));
      }
      ASSERT_OK_AND_ASSIGN(const Capture capture, ImportCapture(files, {.image_scale = 0.25}));
      EXPECT_THAT(capture.warnings,
                  Contains(HasSubstr(absl::StrCat("are of ", NameOf(masks), " pixels"))))
          << orientation;
    }
  }
}

}  // namespace
}  // namespace pepeseg
