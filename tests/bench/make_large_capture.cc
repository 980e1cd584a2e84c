// Developer program: photographs a ray-traced place of real size and writes a dataset folder with
// images/, sparse/0/ and label images of its things in masks/.

#include <Eigen/Geometry>
#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iostream>
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
};

struct Photographer {
  Pose cam_from_world;
  Vector3f center;
  Eigen::Matrix3f world_from_cam;
  float focal = 0, cx = 0, cy = 0;

  // The direction through a point of the picture, 1 long along the camera's axis.
  Vector3f Direction(float x, float y) const {
    return world_from_cam * Vector3f((x - cx) / focal, (y - cy) / focal, 1);
  }
};

// Returns view `index`: rounds at several heights and distances, looking across the middle.
Photographer CameraAt(const CaptureOptions& options, int index) {
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
  Photographer out;
  out.center = eye;
  out.world_from_cam = rotation.transpose();
  const Eigen::Quaterniond quaternion(Eigen::Matrix3d(rotation.cast<double>()));
  out.cam_from_world = {quaternion, -(quaternion * eye.cast<double>())};
  out.focal = 0.8f * static_cast<float>(options.width);
  out.cx = 0.5f * static_cast<float>(options.width);
  out.cy = 0.5f * static_cast<float>(options.height);
  return out;
}

uint8_t Encoded(float linear) {
  return static_cast<uint8_t>(
      std::lround(255 * std::pow(std::clamp(linear, 0.0f, 1.0f), 1 / 2.2f)));
}

std::string NameOf(int index) {
  const std::string digits = std::to_string(index);
  return std::string(4 - digits.size(), '0') + digits;
}

// Four rays a pixel for the photograph, one for the label.
void WriteView(const LargeScene& scene, const CaptureOptions& options, int index) {
  const Photographer camera = CameraAt(options, index);
  const float spread = 1 / camera.focal;
  cv::Mat photo(options.height, options.width, CV_8UC3);
  cv::Mat labels(options.height, options.width, CV_16UC1);
  for (int y = 0; y < options.height; ++y) {
    for (int x = 0; x < options.width; ++x) {
      Vector3f sum = Vector3f::Zero();
      for (int k = 0; k < 4; ++k) {
        const auto u = static_cast<float>(x) + (k % 2 == 0 ? 0.25f : 0.75f);
        const auto v = static_cast<float>(y) + (k < 2 ? 0.25f : 0.75f);
        sum += scene.Color(camera.center, camera.Direction(u, v), spread).cwiseMin(1.0f);
      }
      photo.at<cv::Vec3b>(y, x) = {Encoded(sum.z() / 4), Encoded(sum.y() / 4), Encoded(sum.x() / 4)};
      const auto hit = scene.Trace(camera.center, camera.Direction(static_cast<float>(x) + 0.5f,
                                                                   static_cast<float>(y) + 0.5f));
      labels.at<uint16_t>(y, x) = hit ? hit->piece->thing : 0;
    }
  }
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
    const Photographer camera = CameraAt(options, i % options.num_views);
    const auto u = static_cast<float>(std::fmod(0.5 + 0.7548776662466927 * i, 1.0));
    const auto v = static_cast<float>(std::fmod(0.5 + 0.5698402909980532 * i, 1.0));
    const Vector3f direction = camera.Direction(u * static_cast<float>(options.width),
                                                v * static_cast<float>(options.height));
    const auto hit = scene.Trace(camera.center, direction);
    if (!hit) continue;
    const Vector3f color =
        scene.Color(camera.center, direction, 1 / camera.focal);
    const Vector3f noise(error(random), error(random), error(random));
    const Vector3f at = camera.center + hit->distance * (direction + noise / camera.focal);
    testing::PointRecord point;
    point.id = points.size() + 1;
    for (int k = 0; k < 3; ++k) point.xyz[k] = at[k], point.rgb[k] = Encoded(color[k]);
    points.push_back(point);
  }
  return points;
}

void WriteFile(const std::string& path, const std::string& bytes) {
  std::ofstream(path, std::ios::binary) << bytes;
}

void WriteSparse(const LargeScene& scene, const CaptureOptions& options) {
  const Photographer any = CameraAt(options, 0);
  testing::CameraRecord camera;
  camera.width = options.width, camera.height = options.height;
  camera.parameters = {any.focal, any.focal, any.cx, any.cy};
  std::vector<testing::ImageRecord> images;
  for (int i = 0; i < options.num_views; ++i) {
    const Pose pose = CameraAt(options, i).cam_from_world;
    testing::ImageRecord image;
    image.id = static_cast<uint32_t>(i) + 1;
    image.name = NameOf(i) + ".jpg";
    const auto& q = pose.rotation;
    image.q[0] = q.w(), image.q[1] = q.x(), image.q[2] = q.y(), image.q[3] = q.z();
    for (int k = 0; k < 3; ++k) image.t[k] = pose.translation[k];
    images.push_back(image);
  }
  const std::string folder = options.folder + "/sparse/0/";
  WriteFile(folder + "cameras.bin", testing::CamerasBinary({camera}));
  WriteFile(folder + "images.bin", testing::ImagesBinary(images));
  WriteFile(folder + "points3D.bin", testing::PointsBinary(Points(scene, options)));
}

void Make(const CaptureOptions& options) {
  for (const char* part : {"images", "masks", "sparse/0"}) {
    std::filesystem::create_directories(std::filesystem::path(options.folder) / part);
  }
  const LargeScene scene(options.place == "yard" ? Place::kYard : Place::kWorkshop, options.seed);
  std::cerr << scene.num_pieces() << " pieces, " << scene.num_things() << " things\n";
  WriteSparse(scene, options);
  std::atomic<int> next = 0;
  std::vector<std::jthread> threads;
  for (int t = 0; t < options.threads; ++t) {
    threads.emplace_back([&] {
      for (int i = next++; i < options.num_views; i = next++) WriteView(scene, options, i);
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
  app.add_option("--place", options.place)->check(CLI::IsMember({"yard", "workshop"}));
  app.add_option("--views", options.num_views)->check(CLI::Range(2, 9999));
  app.add_option("--width", options.width)->check(CLI::Range(16, 16384));
  app.add_option("--height", options.height)->check(CLI::Range(16, 16384));
  app.add_option("--points", options.num_points);
  app.add_option("--quality", options.quality, "of the JPEGs")->check(CLI::Range(1, 100));
  app.add_option("--threads", options.threads)->check(CLI::Range(1, 1024));
  app.add_option("--seed", options.seed);
  CLI11_PARSE(app, argc, argv);
  pepeseg::Make(options);
  return 0;
}
