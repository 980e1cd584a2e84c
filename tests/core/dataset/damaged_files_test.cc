#include <gtest/gtest.h>

#include <functional>
#include <random>

#include "core/dataset/depth_files.h"
#include "core/dataset/mask_files.h"
#include "core/formats/colmap.h"
#include "core/formats/gaussian_ply.h"
#include "core/formats/images.h"
#include "core/model_files/model_file.h"
#include "tests/testing/colmap_files.h"
#include "tests/testing/float_files.h"
#include "tests/testing/small_dataset.h"
#include "tests/testing/status_testing.h"

// Files of every kind, cut short or with flipped bytes, must give an error or a value, never a
// crash. Run under the address sanitizer, too.
namespace pepeseg {
namespace {

using testing::TempFolder;
using testing::WriteBytes;

struct Reader {
  std::string name;
  std::string good;
  std::function<absl::Status(const std::filesystem::path&, const std::string&)> read;
};

Reader PlyReader(const TempFolder& folder) {
  Gaussians gaussians = Gaussians::Zero(40, 1);
  for (float& value : gaussians.planes) value = 0.5f;
  EXPECT_OK(WriteGaussianPly(folder / "g", gaussians));
  return {"g.ply", testing::ReadBytes(folder / "g"),
          [](const auto& path, const auto& name) { return ReadGaussianPly(path, name).status(); }};
}

Reader FeatureReader(const TempFolder& folder) {
  FeatureField field;
  field.features.assign(40 * kFeatureDim, 0.5f);
  field.scale_quantiles = {1, 2, 3};
  EXPECT_OK(WriteFeatureFile(folder / "f", field));
  return {"f.bin", testing::ReadBytes(folder / "f"),
          [](const auto& path, const auto& name) { return ReadFeatureFile(path, name).status(); }};
}

std::vector<Reader> Readers(const TempFolder& folder) {
  const testing::SmallDataset dataset;
  const Image picture = testing::Picture(48, 32);
  const auto photo = [](const auto& path, const auto& name) {
    return DecodePhoto(path, name).status();
  };
  const auto masks = [](const auto& path, const auto& name) {
    return ReadMasks(path, name, {"photo", 48, 32}).status();
  };
  const auto cameras = [](const auto& path, const auto& name) {
    return ReadColmapCameras(path, name).status();
  };
  const auto images = [](const auto& path, const auto& name) {
    return ReadColmapImages(path, name).status();
  };
  const auto points = [](const auto& path, const auto& name) {
    return ReadColmapPoints(path, name).status();
  };
  const auto depth = [](const auto& path, const auto& name) {
    return ReadDepthMap(path, name, DepthPrior::Kind::kDepth, {"photo", 48, 32}).status();
  };
  const FloatImage map = {48, 32, std::vector<float>(48 * 32, 2.5f)};
  return {
      PlyReader(folder),
      FeatureReader(folder),
      {"cameras.bin", CamerasBinary(dataset.cameras), cameras},
      {"images.bin", ImagesBinary(dataset.images), images},
      {"points3D.bin", PointsBinary(dataset.points), points},
      {"cameras.txt", CamerasText(dataset.cameras), cameras},
      {"images.txt", ImagesText(dataset.images), images},
      {"points3D.txt", PointsText(dataset.points), points},
      {"a.jpg", testing::Jpeg(picture), photo},
      {"a.png", testing::Png(picture), photo},
      {"label.png", testing::Png({48, 32, 1, std::vector<uint8_t>(48 * 32, 3)}), masks},
      {"depth.png", testing::Png({48, 32, 1, std::vector<uint8_t>(48 * 32, 3)}), depth},
      {"depth.npy", testing::Npy(map), depth},
      {"depth.pfm", testing::Pfm(map), depth},
      {"m.json", R"([{"segmentation": {"size": [32, 48], "counts": [36, 1000, 500]}}])", masks},
  };
}

TEST(DamagedFile, IsNamedIfItIsCutShort) {
  const TempFolder folder;
  for (const Reader& reader : Readers(folder)) {
    WriteBytes(folder / reader.name, reader.good);
    EXPECT_OK(reader.read(folder / reader.name, reader.name));
    // A text file that ends early may still be valid.
    const bool text = reader.name.ends_with(".txt");
    for (int twentieth = 0; twentieth < 20; ++twentieth) {
      WriteBytes(folder / reader.name, reader.good.substr(0, reader.good.size() * twentieth / 20));
      SCOPED_TRACE(twentieth);
      const absl::Status status = reader.read(folder / reader.name, reader.name);
      if (text && status.ok()) continue;
      EXPECT_STATUS(status, absl::StatusCode::kInvalidArgument, reader.name);
    }
  }
}

TEST(DamagedFile, NeverCrashesWithFlippedBytes) {
  const TempFolder folder;
  std::mt19937 random(11);
  for (const Reader& reader : Readers(folder)) {
    for (int round = 0; round < 300; ++round) {
      std::string bytes = reader.good;
      for (unsigned flips = 1 + random() % 4; flips > 0; --flips) {
        bytes[random() % bytes.size()] = static_cast<char>(random());
      }
      WriteBytes(folder / reader.name, bytes);
      const absl::Status status = reader.read(folder / reader.name, reader.name);
      if (status.ok()) continue;
      EXPECT_STATUS(status, absl::StatusCode::kInvalidArgument, reader.name);
    }
  }
}

TEST(DamagedFile, IsRejectedIfBytesFollowAKnownLength) {
  const TempFolder folder;
  for (const Reader& reader : Readers(folder)) {
    if (!reader.name.ends_with(".bin")) continue;
    WriteBytes(folder / reader.name, reader.good + "x");
    EXPECT_STATUS(reader.read(folder / reader.name, reader.name),
                  absl::StatusCode::kInvalidArgument, reader.name);
  }
}

}  // namespace
}  // namespace pepeseg
