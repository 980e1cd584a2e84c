// Developer program: photographs a ray-traced place of real size and writes a dataset folder with
// images/, sparse/0/ and label images of its things in masks/.

#include <CLI/CLI.hpp>
#include <Eigen/Geometry>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <map>
#include <mutex>
#include <numbers>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "core/scene/capture.h"
#include "tests/bench/large_scene.h"
#include "tests/testing/colmap_files.h"

namespace pepeseg {
namespace {

using Eigen::Vector3f;

struct CaptureOptions {
  std::string folder, place = "yard";
  int num_views = 250, width = 1152, height = 864, num_points = 35'000, quality = 95;
  int threads = static_cast<int>(std::thread::hardware_concurrency());
  uint64_t seed = 1;
  LargeScene::LeftOut left_out;
};

// Returns view `index`: rounds at several heights and distances, looking across the middle.
SceneCamera CameraAt(const CaptureOptions& options, int index) {
  std::mt19937_64 random(options.seed * 1000 + static_cast<uint64_t>(index));
  const auto uniform = [&](float low, float high) {
    return low + (high - low) * static_cast<float>(static_cast<double>(random() >> 11) * 0x1p-53);
  };
  const bool yard = options.place == "yard";
  const float angle = 2 * std::numbers::pi_v<float> * 3 *
                      (static_cast<float>(index) + uniform(-0.2f, 0.2f)) /
                      static_cast<float>(options.num_views);
  const float distance = yard ? uniform(6.5f, 9.5f) : uniform(2.2f, 3.8f);
  const Vector3f eye(distance * std::cos(angle), yard ? -uniform(0.9f, 3.2f) : -uniform(1, 2.4f),
                     distance * std::sin(angle));
  const Vector3f target(uniform(-1, 1), yard ? -0.4f : -0.9f, uniform(-1, 1));
  const Vector3f forward = (target - eye).normalized();
  const Vector3f right = Vector3f::UnitY().cross(forward).normalized();
  Eigen::Matrix3f rotation;
  rotation.row(0) = right;
  rotation.row(1) = forward.cross(right);
  rotation.row(2) = forward;
  const auto row = [&](int k) { return Float3{rotation(k, 0), rotation(k, 1), rotation(k, 2)}; };
  return {{eye.x(), eye.y(), eye.z()},
          {row(0), row(1), row(2)},
          options.width,
          options.height,
          0.8f * static_cast<float>(options.width)};
}

std::string NameOf(int index) {
  const std::string digits = std::to_string(index);
  return std::string(4 - digits.size(), '0') + digits;
}

void WriteView(const ScenePicture& picture, const CaptureOptions& options, int index) {
  cv::Mat photo(options.height, options.width, CV_8UC3);
  cv::Mat labels(options.height, options.width, CV_16UC1);
  std::ranges::copy(picture.bgr, photo.data);
  std::ranges::copy(picture.labels, labels.ptr<uint16_t>());
  const std::string name = NameOf(index);
  cv::imwrite(options.folder + "/images/" + name + ".jpg", photo,
              {cv::IMWRITE_JPEG_QUALITY, options.quality});
  cv::imwrite(options.folder + "/masks/" + name + ".png", labels, {cv::IMWRITE_PNG_COMPRESSION, 1});
}

// Points on what the views see, with the error of a feature matcher.
std::vector<testing::PointRecord> Points(const LargeScene& scene, const CaptureOptions& options) {
  std::mt19937_64 random(options.seed);
  std::normal_distribution<float> error(0, 0.5f);  // pixels
  std::vector<testing::PointRecord> points;
  for (int i = 0; static_cast<int>(points.size()) < options.num_points; ++i) {
    const SceneCamera camera = CameraAt(options, i % options.num_views);
    const auto u = static_cast<float>(std::fmod(0.5 + 0.7548776662466927 * i, 1.0));
    const auto v = static_cast<float>(std::fmod(0.5 + 0.5698402909980532 * i, 1.0));
    const Float3 direction = camera.Direction(u * static_cast<float>(options.width),
                                              v * static_cast<float>(options.height));
    const RayHit hit = TraceRay(scene.spans(), camera.center, direction, kFar, false);
    if (hit.piece == nullptr) continue;
    const Float3 color = RayColor(scene.spans(), camera.center, direction, 1 / camera.focal);
    const Float3 noise = {error(random), error(random), error(random)};
    const Float3 at = camera.center + hit.distance * (direction + (1 / camera.focal) * noise);
    testing::PointRecord point;
    point.id = points.size() + 1;
    for (int k = 0; k < 3; ++k) {
      point.xyz[k] = At(at, k);
      point.rgb[k] = EncodedColor(At(color, k));
    }
    points.push_back(point);
  }
  return points;
}

void WriteFile(const std::string& path, const std::string& bytes) {
  std::ofstream(path, std::ios::binary) << bytes;
}

void WriteSparse(const LargeScene& scene, const CaptureOptions& options) {
  const SceneCamera any = CameraAt(options, 0);
  testing::CameraRecord camera;
  camera.width = options.width, camera.height = options.height;
  camera.parameters = {any.focal, any.focal, 0.5 * options.width, 0.5 * options.height};
  std::vector<testing::ImageRecord> images;
  for (int i = 0; i < options.num_views; ++i) {
    const SceneCamera view = CameraAt(options, i);
    const Mat3<float>& m = view.cam_from_world;
    Eigen::Matrix3d rotation;
    for (int k = 0; k < 3; ++k) {
      rotation.row(k) << At(m.row0, k), At(m.row1, k), At(m.row2, k);
    }
    rotation.transposeInPlace();
    const Eigen::Quaterniond q(rotation);
    const Eigen::Vector3d center(view.center.x, view.center.y, view.center.z);
    const Eigen::Vector3d translation = -(q * center);
    testing::ImageRecord image;
    image.id = static_cast<uint32_t>(i) + 1;
    image.name = NameOf(i) + ".jpg";
    image.q[0] = q.w(), image.q[1] = q.x(), image.q[2] = q.y(), image.q[3] = q.z();
    for (int k = 0; k < 3; ++k) image.t[k] = translation[k];
    images.push_back(image);
  }
  const std::string folder = options.folder + "/sparse/0/";
  WriteFile(folder + "cameras.bin", testing::CamerasBinary({camera}));
  WriteFile(folder + "images.bin", testing::ImagesBinary(images));
  WriteFile(folder + "points3D.bin", testing::PointsBinary(Points(scene, options)));
}

// On the GPU as long as it works, else here.
ScenePicture Photograph(const LargeScene& scene, const SceneCamera& camera, ScenePhotographer& gpu,
                        std::mutex& on_gpu) {
  {
    const std::scoped_lock lock(on_gpu);
    if (gpu.ready()) {
      ScenePicture picture = gpu.Photograph(camera);
      if (gpu.ready()) return picture;
    }
  }
  return PhotographScene(scene, camera);
}

void Make(const CaptureOptions& options) {
  for (const char* part : {"images", "masks", "sparse/0"}) {
    std::filesystem::create_directories(std::filesystem::path(options.folder) / part);
  }
  const std::map<std::string, Place> places = {
      {"yard", Place::kYard}, {"workshop", Place::kWorkshop}, {"table", Place::kTable}};
  const LargeScene scene(places.at(options.place), options.seed, options.left_out);
  std::cerr << scene.pieces().size() << " pieces, " << scene.num_things() << " things\n";
  WriteSparse(scene, options);
  ScenePhotographer gpu(scene);
  std::cerr << (gpu.ready() ? "on the GPU\n" : "on the CPU\n");
  std::mutex on_gpu;
  std::atomic<int> next = 0;
  std::vector<std::jthread> threads;
  for (int t = 0; t < options.threads; ++t) {
    threads.emplace_back([&] {
      for (int i = next++; i < options.num_views; i = next++) {
        WriteView(Photograph(scene, CameraAt(options, i), gpu, on_gpu), options, i);
      }
    });
  }
}

}  // namespace
}  // namespace pepeseg

// NOLINTNEXTLINE(bugprone-exception-escape): CLI11 throws only what CLI11_PARSE catches.
int main(int argc, char** argv) {
  CLI::App app("A ray-traced place of real size as a dataset folder");
  pepeseg::CaptureOptions options;
  app.add_option("folder", options.folder)->required();
  app.add_option("--place", options.place)->check(CLI::IsMember({"yard", "workshop", "table"}));
  app.add_option("--views", options.num_views)->check(CLI::Range(2, 9999));
  app.add_option("--width", options.width)->check(CLI::Range(16, 16384));
  app.add_option("--height", options.height)->check(CLI::Range(16, 16384));
  app.add_option("--points", options.num_points);
  app.add_option("--quality", options.quality, "of the JPEGs")->check(CLI::Range(1, 100));
  app.add_option("--threads", options.threads)->check(CLI::Range(1, 1024));
  app.add_option("--seed", options.seed);
  app.add_option("--without", options.left_out.thing, "a thing, by its label, that is left out");
  app.add_flag("--keep-shadow", options.left_out.keeps_shadow, "of the thing that is left out");
  CLI11_PARSE(app, argc, argv);
  pepeseg::Make(options);
  return 0;
}
