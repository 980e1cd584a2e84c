#include "server/rpc/dataset_size.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <limits>
#include <string>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "core/io/file_bytes.h"
#include "core/io/image_header.h"
#include "core/io/ply.h"
#include "core/status_macros.h"
#include "server/rpc/estimate_training.h"

namespace pepeseg {
namespace {

constexpr size_t kMostHeaders = 48;
constexpr int64_t kMaxPhotoBytes = int64_t{1} << 30;
// Of a frame that is taken from a video: they are shrunk to 1600 pixels on the longer side.
constexpr int64_t kVideoFramePixels = 1600 * 1200;
// Points that the stage "sfm" makes of a photograph: 215 of llff_fern's, 234 of fox's.
constexpr int64_t kPointsOfPhoto = 250;
constexpr int64_t kMaxPoints = 50'000'000;

// Where the files' bytes are.
struct Blobs {
  const BlobStore& store;
  std::string project;
  std::filesystem::path Path(const std::string& sha256) const {
    return store.Path({project, sha256});
  }
};

absl::StatusOr<int64_t> PixelsOf(const Blobs& blobs, const DatasetFileRow& file) {
  ASSIGN_OR_RETURN(const std::string bytes,
                   ReadFile(blobs.Path(file.sha256), file.path, kMaxPhotoBytes));
  const std::span<const uint8_t> span(reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size());
  ASSIGN_OR_RETURN(const ImageHeader header, ReadImageHeader(file.path, span));
  return int64_t{header.width} * header.height;
}

absl::Status Unreadable(const DatasetFileRow& file) {
  return absl::InternalError(absl::StrCat(file.path, ": cannot be read"));
}

// COLMAP's count of points, no more than the file can hold.
absl::StatusOr<int64_t> CountBinaryPoints(const std::filesystem::path& path,
                                          const DatasetFileRow& row) {
  constexpr int64_t kLeastRecord = 43;
  std::ifstream file(path, std::ios::binary);
  uint64_t count = 0;
  file.read(reinterpret_cast<char*>(&count), sizeof(count));
  if (!file.is_open() || file.bad()) return Unreadable(row);
  const auto most = static_cast<uint64_t>(row.size / kLeastRecord);
  return file ? static_cast<int64_t>(std::min(count, most)) : 0;
}

absl::StatusOr<int64_t> CountTextPoints(const std::filesystem::path& path,
                                        const DatasetFileRow& row) {
  std::ifstream file(path);
  int64_t count = 0;
  while (file.good()) {
    const int first = file.peek();
    if (first != '#' && first != '\n' && first != std::ifstream::traits_type::eof()) ++count;
    file.ignore(std::numeric_limits<std::streamsize>::max(), '\n');
  }
  if (!file.is_open() || file.bad()) return Unreadable(row);
  return count;
}

// 0 where it is no PLY file that can be taken: the job says why.
absl::StatusOr<int64_t> CountPly(const Blobs& blobs, const DatasetFileRow& file) {
  const auto ply = OpenPly(blobs.Path(file.sha256), file.path, kMaxPoints);
  if (absl::IsInvalidArgument(ply.status())) return 0;
  RETURN_IF_ERROR(ply.status());
  return ply->count;
}

absl::StatusOr<int64_t> CountPoints(const Blobs& blobs, const DatasetFileRow& file) {
  const std::filesystem::path path = blobs.Path(file.sha256);
  if (file.kind == v1::FILE_KIND_POINTS) return CountPly(blobs, file);
  if (absl::EndsWith(file.path, "points3D.bin")) return CountBinaryPoints(path, file);
  return absl::EndsWith(file.path, "points3D.txt") ? CountTextPoints(path, file) : 0;
}

int64_t CountKind(const std::vector<DatasetFileRow>& files, v1::FileKind kind) {
  return std::count_if(files.begin(), files.end(),
                       [kind](const DatasetFileRow& file) { return file.kind == kind; });
}

struct PhotoRules {
  double image_scale;
  int64_t num_video_frames;  // of all videos together
};

absl::Status MeasurePhotos(const Blobs& blobs, const std::vector<DatasetFileRow>& files,
                           const PhotoRules& rules, DatasetSize& size) {
  std::vector<const DatasetFileRow*> photos;
  for (const DatasetFileRow& file : files) {
    if (file.kind == v1::FILE_KIND_IMAGE) photos.push_back(&file);
  }
  if (photos.empty() && rules.num_video_frames == 0) {
    return absl::InvalidArgumentError("the dataset has no photograph");
  }
  const size_t num_read = std::min(photos.size(), kMostHeaders);
  int64_t sum = 0;
  for (size_t i = 0; i < num_read; ++i) {
    ASSIGN_OR_RETURN(const int64_t pixels, PixelsOf(blobs, *photos[i * photos.size() / num_read]));
    sum += pixels;
    size.max_source_pixels = std::max(size.max_source_pixels, pixels);
  }
  if (rules.num_video_frames > 0) {
    size.max_source_pixels = std::max(size.max_source_pixels, kVideoFramePixels);
  }
  const auto scaled = [&rules](double pixels) {
    return static_cast<int64_t>(std::ceil(pixels * rules.image_scale * rules.image_scale));
  };
  const double mean = static_cast<double>(sum) / static_cast<double>(std::max<size_t>(1, num_read));
  const auto video_pixels = static_cast<double>(rules.num_video_frames * kVideoFramePixels);
  TrainingSize& training = size.training;
  training.num_views = static_cast<int64_t>(photos.size()) + rules.num_video_frames;
  training.num_pixels = scaled(mean * static_cast<double>(photos.size()) + video_pixels);
  training.max_pixels = scaled(static_cast<double>(size.max_source_pixels));
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<DatasetSize> MeasureDataset(const ServiceContext& context,
                                           const WantedTraining& training) {
  ASSIGN_OR_RETURN(const std::vector<DatasetFileRow> files,
                   context.store->ListDatasetFiles(training.scene, training.dataset));
  ASSIGN_OR_RETURN(const std::string project, context.store->ProjectOfScene(training.scene));
  const Blobs blobs{*context.blobs, project};
  const ImportOptions& import = training.settings.import;
  DatasetSize size;
  const PhotoRules rules{import.image_scale, CountKind(files, v1::FILE_KIND_VIDEO) *
                                                 training.settings.sfm.max_video_frames};
  RETURN_IF_ERROR(MeasurePhotos(blobs, files, rules, size));
  size.has_poses = CountKind(files, v1::FILE_KIND_POSES) > 0;
  TrainingSize& counts = size.training;
  const int64_t every = import.held_out_every;
  const int64_t held_out = every > 0 ? (counts.num_views + every - 1) / every : 0;
  counts.num_training_views = std::max<int64_t>(1, counts.num_views - held_out);
  counts.num_masked_views = std::min(counts.num_views, CountKind(files, v1::FILE_KIND_MASK));
  // One mask may be for all views.
  if (CountKind(files, v1::FILE_KIND_IGNORE_MASK) > 0) counts.num_ignore_views = counts.num_views;
  counts.num_depth_views =
      std::min(counts.num_views,
               CountKind(files, v1::FILE_KIND_DEPTH) + CountKind(files, v1::FILE_KIND_DISPARITY));
  for (const DatasetFileRow& file : files) {
    if (file.kind == v1::FILE_KIND_GAUSSIANS) {
      ASSIGN_OR_RETURN(size.num_given_gaussians, CountPly(blobs, file));
    }
    ASSIGN_OR_RETURN(const int64_t num_points, CountPoints(blobs, file));
    counts.num_points = std::max(counts.num_points, num_points);
  }
  if (!size.has_poses) counts.num_points = kPointsOfPhoto * counts.num_views;
  return size;
}

}  // namespace pepeseg
