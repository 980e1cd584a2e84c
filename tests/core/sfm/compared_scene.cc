#include "tests/core/sfm/compared_scene.h"

#include <Eigen/Core>
#include <fstream>
#include <random>

#include "absl/strings/str_format.h"
#include "core/scene/lens.h"
#include "tests/testing/colmap_files.h"

namespace pepeseg::testing {
namespace {

constexpr double kParameters[] = {500, 320, 240, 0.05};

std::string NameOf(int photograph) { return absl::StrFormat("c1/%06d.jpg", photograph + 1); }

Eigen::Vector3d CentreOf(int photograph) { return {0.4 * photograph, 0.05 * photograph, 0}; }

}  // namespace

ComparedDatabase CompareScene() {
  const Lens lens = MakeLens(LensModel::kSimpleRadial, 640, 480, kParameters);
  std::mt19937 random(1);
  std::uniform_real_distribution<double> side(-1.5, 1.5), depth(4, 8);
  ComparedDatabase compared;
  compared.feature_side = 2000;
  compared.features.cameras = {{1, 2, 640, 480, {500, 320, 240, 0.05}, false}};
  for (int i = 0; i < kNumPhotographs; ++i) {
    compared.features.images.push_back({i + 1, NameOf(i), 0, {}});
  }
  for (int k = 0; k < kNumPoints; ++k) {
    const Eigen::Vector3d point(side(random), side(random), depth(random));
    for (int i = 0; i < kNumPhotographs; ++i) {
      const Eigen::Vector3d seen = point - CentreOf(i);
      const Eigen::Vector2d pixel = lens.Project(seen.head<2>() / seen.z());
      compared.features.images[i].features.keypoints.push_back(
          {static_cast<float>(pixel.x()), static_cast<float>(pixel.y()), 2, 0});
    }
  }
  for (size_t a = 0; a < kNumPhotographs; ++a) {
    for (size_t b = a + 1; b < kNumPhotographs; ++b) {
      ComparedPair pair{a, b, {}, {}};
      pair.geometry.kind = TwoViewKind::kUncalibrated;
      pair.geometry.homography.setIdentity();
      for (uint32_t k = 0; k < kNumPoints; ++k) pair.geometry.inliers.push_back({k, k});
      compared.pairs.push_back(pair);
    }
  }
  return compared;
}

void WriteSceneModel(const std::filesystem::path& folder, const std::set<int>& misplaced) {
  std::filesystem::create_directories(folder);
  CameraRecord camera;
  camera.model = 2, camera.width = 640, camera.height = 480;
  camera.parameters.assign(std::begin(kParameters), std::end(kParameters));
  std::vector<ImageRecord> images;
  for (int i = 0; i < kNumPhotographs; ++i) {
    ImageRecord& image = images.emplace_back();
    image.id = static_cast<uint32_t>(i + 1);
    image.name = NameOf(i);
    const Eigen::Vector3d centre =
        misplaced.contains(i) ? Eigen::Vector3d(1, 3.0 + i, -2) : CentreOf(i);
    for (int axis = 0; axis < 3; ++axis) image.t[axis] = -centre[axis];
  }
  const auto write = [&](const char* name, const std::string& bytes) {
    std::ofstream(folder / name, std::ios::binary) << bytes;
  };
  write("cameras.bin", CamerasBinary({camera}));
  write("images.bin", ImagesBinary(images));
  write("points3D.bin", PointsBinary({PointRecord{}}));
}

}  // namespace pepeseg::testing
