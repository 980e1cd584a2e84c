#include "tests/testing/textured_place.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cassert>
#include <cmath>
#include <utility>

namespace pepeseg::testing {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3i;

// Returns a pseudorandom number in [0, 1], a hash of cell and seed.
double Noise(const Vector3i& cell, uint32_t seed) {
  uint32_t hash = seed * 0x9e3779b9u;
  for (int axis = 0; axis < 3; ++axis) {
    hash ^= static_cast<uint32_t>(cell[axis]) * 0x85ebca6bu;
    hash = (hash ^ (hash >> 15)) * 0x2c1b3c6du;
    hash ^= hash >> 13;
  }
  return static_cast<double>(hash & 0xffffu) / 65535;
}

// Returns noise in [0, 1] at a point: the sum of cubes of four sizes, 1/3 to 1/24.
double Texture(const Vector3d& point, uint32_t seed) {
  double sum = 0;
  for (int octave = 0; octave < 4; ++octave) {
    const Vector3d scaled = point * (3 << octave) + Vector3d::Constant(0.37);
    const Vector3i cell = scaled.array().floor().cast<int>();
    sum += Noise(cell, seed + static_cast<uint32_t>(octave)) / 4;
  }
  return std::clamp(0.5 + 2 * (sum - 0.5), 0.0, 1.0);
}

std::vector<Surface> Surfaces(uint32_t seed) {
  std::vector<Surface> surfaces = {{0, false, {0, 0, 1.5}, {4, 3, 0.1}, {1, 1, 1}}};
  for (int i = 0; i < 5; ++i) {
    const double x = -1.4 + 0.7 * i;
    const Vector3i place(i, 0, 0);
    const Vector3d center(x, Noise(place, seed) - 0.5, Noise(place, seed + 7) - 0.6);
    surfaces.push_back({i + 1, false, center, {0.28, 0.3, 0.25}, {1, 1, 1}});
  }
  return surfaces;
}

void TakePhoto(const std::vector<Surface>& surfaces, uint32_t seed, View& view) {
  constexpr int kSide = 2;  // rays of a pixel, each way
  const int width = view.camera.width, height = view.camera.height;
  view.photo = {width, height, 3, {}};
  view.photo.pixels.reserve(static_cast<size_t>(width) * height * 3);
  for (int i = 0; i < width * height; ++i) {
    double sum = 0;
    for (int j = 0; j < kSide * kSide; ++j) {
      const int column = i % width * kSide + j % kSide, row = i / width * kSide + j / kSide;
      const double x = (column + 0.5) / kSide, y = (row + 0.5) / kSide;
      const Ray ray = PixelRay(view, x, y);
      const Hit hit = Trace(surfaces, ray);
      if (hit.surface == nullptr) continue;
      const auto label = static_cast<uint32_t>(hit.surface->label);
      sum += Texture(ray.origin + hit.distance * ray.direction, seed + 100 * label);
    }
    const auto grey = static_cast<uint8_t>(std::lround(255 * sum / (kSide * kSide)));
    view.photo.pixels.insert(view.photo.pixels.end(), {grey, grey, grey});
  }
}

Eigen::Matrix3Xd Columns(std::span<const Eigen::Vector3d> points) {
  Eigen::Matrix3Xd columns(3, points.size());
  for (size_t i = 0; i < points.size(); ++i) {
    columns.col(static_cast<Eigen::Index>(i)) = points[i];
  }
  return columns;
}

}  // namespace

ViewArc PlaceArc(int num_views) {
  ViewArc arc;
  arc.num_views = num_views;
  arc.width = 320;
  arc.height = 240;
  arc.angle = 0.12 * num_views;
  return arc;
}

std::vector<View> PhotographPlace(std::vector<View> views, uint32_t seed) {
  const std::vector<Surface> surfaces = Surfaces(seed);
  for (View& view : views) TakePhoto(surfaces, seed, view);
  return views;
}

std::vector<View> PhotographPlace(const ViewArc& arc, uint32_t seed) {
  std::vector<View> views;
  for (int i = 0; i < arc.num_views; ++i) views.push_back(PlaceView(arc, i));
  return PhotographPlace(std::move(views), seed);
}

std::vector<View> PlaceTurn(int num_views) {
  std::vector<View> views;
  for (int i = 0; i < num_views; ++i) {
    views.push_back(PlaceView(PlaceArc(1), 0));
    const double tilt = 0.05 * (i % 2);
    const Eigen::Quaterniond turn =
        Eigen::AngleAxisd(0.08 * (i - num_views / 2.0), Vector3d::UnitY()) *
        Eigen::AngleAxisd(tilt, Vector3d::UnitX());
    Pose& pose = views.back().cam_from_world;
    pose.rotation = turn * pose.rotation;
    pose.translation = turn * pose.translation;
  }
  return views;
}

Image Blurred(const Image& photo, int radius) {
  Image blurred = photo;
  for (int y = 0; y < photo.height; ++y) {
    for (int x = 0; x < photo.width; ++x) {
      int sum = 0, count = 0;
      for (int v = std::max(0, y - radius); v <= std::min(photo.height - 1, y + radius); ++v) {
        for (int u = std::max(0, x - radius); u <= std::min(photo.width - 1, x + radius); ++u) {
          sum += photo.pixels[static_cast<size_t>(v * photo.width + u) * 3];
          ++count;
        }
      }
      const size_t at = static_cast<size_t>(y * photo.width + x) * 3;
      std::fill_n(blurred.pixels.begin() + static_cast<ptrdiff_t>(at), 3,
                  static_cast<uint8_t>(sum / count));
    }
  }
  return blurred;
}

Eigen::Matrix4d FitSimilarity(std::span<const Eigen::Vector3d> estimated,
                              std::span<const Eigen::Vector3d> truth) {
  assert(estimated.size() == truth.size() && truth.size() >= 3);
  return Eigen::umeyama(Columns(estimated), Columns(truth), /*with_scaling=*/true);
}

double CenterError(std::span<const Eigen::Vector3d> estimated,
                   std::span<const Eigen::Vector3d> truth) {
  const Eigen::Matrix4d similarity = FitSimilarity(estimated, truth);
  const Eigen::Matrix3Xd from = Columns(estimated), to = Columns(truth);
  const Eigen::Matrix3Xd moved =
      (similarity.topLeftCorner<3, 3>() * from).colwise() + similarity.topRightCorner<3, 1>();
  const Eigen::Vector3d mean = to.rowwise().mean();
  return std::sqrt((moved - to).squaredNorm() / (to.colwise() - mean).squaredNorm());
}

}  // namespace pepeseg::testing
