#include "core/sfm/colmap_model_writer.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <optional>
#include <string>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/file_io.h"
#include "core/base/status_macros.h"
#include "core/formats/images.h"
#include "kernels/thread_pool.h"

namespace pepeseg {
namespace {

constexpr int kSimpleRadial = 2;
constexpr uint64_t kNoPoint = ~uint64_t{0};

// Appends a value as the program's little-endian machines hold it.
template <typename T>
void Put(T value, std::string& bytes) {
  bytes.append(reinterpret_cast<const char*>(&value), sizeof(value));
}

// An observation of a photograph, and its place among those of all points.
struct Sample {
  uint32_t feature = 0;
  size_t place = 0;
};

std::string CamerasOf(const DatabaseFeatures& features, const GlobalModel& model) {
  std::string bytes;
  Put<uint64_t>(features.cameras.size(), bytes);
  for (size_t i = 0; i < features.cameras.size(); ++i) {
    const GroupLens& lens = model.lenses[i];
    Put(static_cast<uint32_t>(features.cameras[i].id), bytes);
    Put(int32_t{kSimpleRadial}, bytes);
    Put(static_cast<uint64_t>(lens.width), bytes);
    Put(static_cast<uint64_t>(lens.height), bytes);
    for (const double value : {lens.focal, lens.Centre().x(), lens.Centre().y(), lens.k1}) {
      Put(value, bytes);
    }
  }
  return bytes;
}

// Returns the points that features show, by photograph and feature; points count from 1.
std::vector<std::vector<uint64_t>> PointsOfFeatures(const DatabaseFeatures& features,
                                                    const GlobalModel& model) {
  std::vector<std::vector<uint64_t>> points;
  for (const DatabaseImage& image : features.images) {
    points.emplace_back(image.features.keypoints.size(), kNoPoint);
  }
  for (size_t p = 0; p < model.points.size(); ++p) {
    for (const Observation& o : model.points[p].track) points[o.photograph][o.feature] = p + 1;
  }
  return points;
}

std::string ImagesOf(const DatabaseFeatures& features, const GlobalModel& model) {
  const std::vector<std::vector<uint64_t>> points = PointsOfFeatures(features, model);
  std::string bytes;
  Put(static_cast<uint64_t>(std::count_if(model.poses.begin(), model.poses.end(),
                                          [](const CameraPose& p) { return p.is_registered; })),
      bytes);
  for (size_t i = 0; i < features.images.size(); ++i) {
    const CameraPose& pose = model.poses[i];
    if (!pose.is_registered) continue;
    const DatabaseImage& image = features.images[i];
    const Eigen::Quaterniond q(pose.rotation);
    Put(static_cast<uint32_t>(image.id), bytes);
    for (const double value : {q.w(), q.x(), q.y(), q.z()}) Put(value, bytes);
    for (int axis = 0; axis < 3; ++axis) Put(pose.translation[axis], bytes);
    Put(static_cast<uint32_t>(features.cameras[image.camera].id), bytes);
    bytes.append(image.name).push_back('\0');
    Put<uint64_t>(image.features.keypoints.size(), bytes);
    for (size_t k = 0; k < image.features.keypoints.size(); ++k) {
      Put<double>(image.features.keypoints[k].x, bytes);
      Put<double>(image.features.keypoints[k].y, bytes);
      Put(points[i][k], bytes);
    }
  }
  return bytes;
}

// Returns the mean distance between a point's image and its features, pixels.
double MeanError(const DatabaseFeatures& features, const GlobalModel& model,
                 const MappedPoint& point) {
  double sum = 0;
  for (const Observation& o : point.track) {
    const DatabaseImage& image = features.images[o.photograph];
    const Keypoint& keypoint = image.features.keypoints[o.feature];
    const Eigen::Vector3d seen = model.poses[o.photograph].ToCamera(point.position);
    sum +=
        (model.lenses[image.camera].Project(seen) - Eigen::Vector2d(keypoint.x, keypoint.y)).norm();
  }
  return sum / static_cast<double>(std::max<size_t>(point.track.size(), 1));
}

std::string PointsOf(const DatabaseFeatures& features, const GlobalModel& model,
                     std::span<const PointColour> colours) {
  std::string bytes;
  Put<uint64_t>(model.points.size(), bytes);
  for (size_t p = 0; p < model.points.size(); ++p) {
    const MappedPoint& point = model.points[p];
    Put<uint64_t>(p + 1, bytes);
    for (int axis = 0; axis < 3; ++axis) Put(point.position[axis], bytes);
    for (const uint8_t value : colours[p]) Put(value, bytes);
    Put(MeanError(features, model, point), bytes);
    Put<uint64_t>(point.track.size(), bytes);
    for (const Observation& o : point.track) {
      Put(static_cast<uint32_t>(features.images[o.photograph].id), bytes);
      Put(o.feature, bytes);
    }
  }
  return bytes;
}

}  // namespace

absl::StatusOr<std::vector<PointColour>> ColourPoints(std::span<const SfmPhotograph> photographs,
                                                      const DatabaseFeatures& features,
                                                      const GlobalModel& model, int num_threads) {
  std::vector<std::vector<Sample>> samples(features.images.size());
  size_t num_samples = 0;
  for (const MappedPoint& point : model.points) {
    for (const Observation& o : point.track) {
      samples[o.photograph].push_back({o.feature, num_samples++});
    }
  }
  std::vector<PointColour> sampled(num_samples);
  std::vector<absl::Status> statuses(photographs.size());
  ThreadPool(num_threads)
      .ParallelFor(static_cast<int64_t>(photographs.size()), [&](int64_t i, int) {
        if (samples[i].empty()) return;
        const absl::StatusOr<Image> image = DecodePhoto(photographs[i].path, photographs[i].name);
        statuses[i] = image.status();
        if (!image.ok()) return;
        for (const Sample& sample : samples[i]) {
          // The centre of the first pixel is (0.5, 0.5).
          const Keypoint& keypoint = features.images[i].features.keypoints[sample.feature];
          const int x = std::clamp(static_cast<int>(keypoint.x), 0, image->width - 1);
          const int y = std::clamp(static_cast<int>(keypoint.y), 0, image->height - 1);
          const uint8_t* pixel =
              &image->pixels[static_cast<size_t>(image->channels) *
                             (static_cast<size_t>(y) * static_cast<size_t>(image->width) +
                              static_cast<size_t>(x))];
          for (int c = 0; c < 3; ++c)
            sampled[sample.place][c] = pixel[image->channels == 3 ? c : 0];
        }
      });
  for (const absl::Status& status : statuses) RETURN_IF_ERROR(status);
  std::vector<PointColour> colours;
  size_t place = 0;
  for (const MappedPoint& point : model.points) {
    int sums[3] = {};
    for (size_t k = 0; k < point.track.size(); ++k, ++place) {
      for (int c = 0; c < 3; ++c) sums[c] += sampled[place][c];
    }
    const int count = std::max(1, static_cast<int>(point.track.size()));
    PointColour& colour = colours.emplace_back();
    for (int c = 0; c < 3; ++c) colour[c] = static_cast<uint8_t>((sums[c] + count / 2) / count);
  }
  return colours;
}

absl::Status WriteColmapModel(const DatabaseFeatures& features, const GlobalModel& model,
                              std::span<const PointColour> colours,
                              const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) {
    return absl::InternalError(
        absl::StrCat("cannot make ", folder.string(), ": ", error.message()));
  }
  RETURN_IF_ERROR(WriteFileAtomically(folder / "cameras.bin", CamerasOf(features, model)));
  RETURN_IF_ERROR(WriteFileAtomically(folder / "images.bin", ImagesOf(features, model)));
  return WriteFileAtomically(folder / "points3D.bin", PointsOf(features, model, colours));
}

}  // namespace pepeseg
