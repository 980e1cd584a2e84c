#include "server/services/dataset_size.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "server/services/estimate_training.h"
#include "server/services/file_header.h"

namespace pepeseg {
namespace {

// Headers read in one call, of photographs and of points each.
constexpr size_t kMostHeaders = 48;
// Of a frame that is taken from a video: they are shrunk to 1600 pixels on the longer side.
constexpr int64_t kVideoFramePixels = 1600 * 1200;
// Points that the stage "sfm" makes of a photograph: 215 of llff_fern's, 234 of fox's.
constexpr int64_t kPointsOfPhoto = 250;

// Where the files' bytes are.
struct Blobs {
  const BlobStore& store;
  std::string project;
  std::filesystem::path Path(const std::string& sha256) const {
    return store.Path({project, sha256});
  }
};

// Reads up to kMostHeaders of the files' headers, spread evenly, into `read`, too.
absl::Status ReadSome(const Blobs& blobs, const std::vector<DatasetFileRow*>& files,
                      CheckWanted wanted, std::vector<DatasetFileRow>& read) {
  const size_t num_read = std::min(files.size(), kMostHeaders);
  for (size_t i = 0; i < num_read; ++i) {
    RETURN_IF_ERROR(wanted());
    DatasetFileRow& file = *files[i * files.size() / num_read];
    RETURN_IF_ERROR(ReadFileHeader(blobs.Path(file.sha256), file));
    read.push_back(file);
  }
  return absl::OkStatus();
}

// Reads headers that were not read when their files were stored, and keeps what they say: of
// datasets that an earlier version stored, or whose bytes were there before their upload.
absl::Status ReadMissingHeaders(Store& store, const Blobs& blobs, const WantedTraining& training,
                                CheckWanted wanted, std::vector<DatasetFileRow>& files) {
  std::vector<DatasetFileRow*> photos, points;
  for (DatasetFileRow& file : files) {
    if (file.header != HeaderState::kUnread || !HasHeader(file)) continue;
    (file.kind == v1::FILE_KIND_IMAGE ? photos : points).push_back(&file);
  }
  std::vector<DatasetFileRow> read;
  absl::Status status = ReadSome(blobs, photos, wanted, read);
  if (status.ok()) status = ReadSome(blobs, points, wanted, read);
  // The next call need not read them again, also where this one is cancelled.
  if (!read.empty()) {
    status.Update(store.files().SetFileHeaders(training.scene, training.dataset, read));
  }
  return status;
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
  int64_t sum = 0;
  int64_t num_known = 0;
  for (const DatasetFileRow* photo : photos) {
    if (photo->header == HeaderState::kRefused) return RefusalOf(blobs.Path(photo->sha256), *photo);
    if (photo->header == HeaderState::kUnread) continue;
    const int64_t pixels = int64_t{photo->width} * photo->height;
    sum += pixels;
    ++num_known;
    size.max_source_pixels = std::max(size.max_source_pixels, pixels);
  }
  if (rules.num_video_frames > 0) {
    size.max_source_pixels = std::max(size.max_source_pixels, kVideoFramePixels);
  }
  const auto scaled = [&rules](double pixels) {
    return static_cast<int64_t>(std::ceil(pixels * rules.image_scale * rules.image_scale));
  };
  const double mean =
      static_cast<double>(sum) / static_cast<double>(std::max<int64_t>(1, num_known));
  const auto video_pixels = static_cast<double>(rules.num_video_frames * kVideoFramePixels);
  TrainingSize& training = size.training;
  training.num_views = static_cast<int64_t>(photos.size()) + rules.num_video_frames;
  training.num_pixels = scaled(mean * static_cast<double>(photos.size()) + video_pixels);
  training.max_pixels = scaled(static_cast<double>(size.max_source_pixels));
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<DatasetSize> MeasureDataset(const ServiceContext& context,
                                           const WantedTraining& training, CheckWanted wanted) {
  ASSIGN_OR_RETURN(std::vector<DatasetFileRow> files,
                   context.store->files().ListDatasetFiles(training.scene, training.dataset));
  ASSIGN_OR_RETURN(const std::string project,
                   context.store->scenes().ProjectOfScene(training.scene));
  const Blobs blobs{*context.blobs, project};
  RETURN_IF_ERROR(ReadMissingHeaders(*context.store, blobs, training, wanted, files));
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
    int64_t& most =
        file.kind == v1::FILE_KIND_GAUSSIANS ? size.num_given_gaussians : counts.num_points;
    most = std::max(most, file.num_points);
  }
  if (!size.has_poses) counts.num_points = kPointsOfPhoto * counts.num_views;
  return size;
}

}  // namespace pepeseg
