#include "tests/testing/small_dataset.h"

#include <cmath>
#include <fstream>
#include <iterator>

#include "core/base/status_macros.h"
#include "core/formats/images.h"
#include "tests/testing/status_testing.h"

namespace pepeseg::testing {

constexpr int kWidth = 40;
constexpr int kHeight = 30;

void WriteBytes(const std::filesystem::path& path, const std::string& bytes) {
  std::filesystem::create_directories(path.parent_path());
  std::ofstream file(path, std::ios::binary);
  file.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  ASSERT_TRUE(file.flush()) << path;
}

std::string ReadBytes(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

Image Picture(int width, int height) {
  Image image{width, height, 3, {}};
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const double u = (x + 0.5) / width, v = (y + 0.5) / height;
      for (const double wave : {std::sin(9 * u + 2 * v), std::cos(3 * u - 8 * v), u * v}) {
        image.pixels.push_back(static_cast<uint8_t>(127.5 + 120 * wave));
      }
    }
  }
  return image;
}

std::string Png(const Image& image) {
  absl::StatusOr<std::string> bytes = EncodePng(image);
  EXPECT_OK(bytes);
  return bytes.value_or("");
}

std::string Jpeg(const Image& image) {
  absl::StatusOr<std::string> bytes = EncodeJpeg(image, 95);
  EXPECT_OK(bytes);
  return bytes.value_or("");
}

SmallDataset::SmallDataset() {
  cameras = {{1, 1, "PINHOLE", kWidth, kHeight, {50, 51, 21, 14}}};
  images = {{7, {1, 0, 0, 0}, {0, 0, 4}, 1, "a.jpg", 2},
            {3, {0.8, 0.6, 0, 0}, {1, 2, 3}, 1, "images/b.jpg", 0},
            {5, {0, 0, 0, -1}, {-1, 0.25, 3}, 1, "sub/c.png", 1}};
  points = {{4, {1, 2, 3}, {255, 128, 0}, 3}, {9, {-1, 0.5, 2}, {1, 2, 3}, 0}};
}

void SmallDataset::Write() const {
  const Image picture = Picture(kWidth, kHeight);
  for (const char* name : {"images/a.jpg", "images/b.jpg", "images/sub/c.png"}) {
    if (std::filesystem::exists(folder / name)) continue;
    WriteBytes(folder / name, Png(picture));
    if (name != std::string("images/sub/c.png")) WriteBytes(folder / name, Jpeg(picture));
  }
  // Columns 0 to 3, and the upper 15 rows of them.
  if (!std::filesystem::exists(folder / "masks/a.json")) {
    WriteBytes(folder / "masks/a.json",
               R"([{"area": 120, "segmentation": {"size": [30, 40], "counts": [0, 120, 1080]}},
                   {"segmentation": {"size": [30, 40], "counts":
                    [0, 15, 15, 15, 15, 15, 15, 15, 1095]}}])");
  }
  Image ignore{kWidth, kHeight, 1, std::vector<uint8_t>(kWidth * kHeight, 0)};
  ignore.pixels[5] = 255;
  if (!std::filesystem::exists(folder / "ignore_mask.png")) {
    WriteBytes(folder / "ignore_mask.png", Png(ignore));
  }
  const std::filesystem::path sparse = folder / "sparse" / "0";
  WriteBytes(sparse / (text ? "cameras.txt" : "cameras.bin"),
             text ? CamerasText(cameras) : CamerasBinary(cameras));
  WriteBytes(sparse / (text ? "images.txt" : "images.bin"),
             text ? ImagesText(images) : ImagesBinary(images));
  WriteBytes(sparse / (text ? "points3D.txt" : "points3D.bin"),
             text ? PointsText(points) : PointsBinary(points));
}

absl::StatusOr<Capture> SmallDataset::Import(const ImportOptions& options) const {
  ASSIGN_OR_RETURN(const std::vector<DatasetFile> files, ListDataset(folder.path()));
  return ImportCapture(files, options);
}

}  // namespace pepeseg::testing
