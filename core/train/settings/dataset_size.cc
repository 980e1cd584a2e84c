#include <algorithm>
#include <cmath>
#include <cstdint>

#include "core/dataset/video_frames.h"
#include "core/formats/movie_size.h"
#include "core/train/settings/estimate.h"

namespace pepeseg {
namespace {

// Size of a frame of a video: frames are shrunk to 1600 pixels on the longer side.
constexpr int64_t kVideoFramePixels = 1600 * 1200;
// Points that the stage "sfm" finds for each photograph; measured: 215 for llff_fern, 234 for fox.
constexpr int64_t kPointsOfPhoto = 250;

int64_t NumOfKind(std::span<const MeasuredFile> files, FileKind kind) {
  return std::ranges::count_if(files, [&](const auto& file) { return file.file.kind == kind; });
}

// Returns how many frames of the videos become photographs, and adds all that they have to `size`.
int64_t MeasureVideos(std::span<const MeasuredFile> files, int64_t max_frames, DatasetSize& size) {
  int64_t num_photos = 0;
  for (const MeasuredFile& file : files) {
    if (file.file.kind != FileKind::kVideo) continue;
    const MovieSize movie = ReadMovieSize(file.file.path);
    num_photos += ExpectedFrames(movie.num_frames, max_frames);
    size.video_megapixels +=
        1e-6 * static_cast<double>(movie.num_frames) * movie.width * movie.height;
  }
  return num_photos;
}

// Sums the pixels of all views, which are photographs and frames of videos.
void MeasurePhotos(std::span<const MeasuredFile> files, int64_t num_frames, double image_scale,
                   DatasetSize& size) {
  int64_t sum = 0, num_known = 0;
  for (const MeasuredFile& file : files) {
    if (file.file.kind != FileKind::kImage || file.facts.width == 0) continue;
    const int64_t pixels = int64_t{file.facts.width} * file.facts.height;
    sum += pixels;
    ++num_known;
    size.max_source_pixels = std::max(size.max_source_pixels, pixels);
  }
  if (num_frames > 0) size.max_source_pixels = std::max(size.max_source_pixels, kVideoFramePixels);
  // `image_scale` shrinks both sides, so the pixels shrink by its square.
  const auto scaled = [&](double pixels) {
    return static_cast<int64_t>(std::ceil(pixels * image_scale * image_scale));
  };
  const double mean =
      static_cast<double>(sum) / static_cast<double>(std::max<int64_t>(1, num_known));
  const int64_t num_photos = NumOfKind(files, FileKind::kImage);
  size.training.num_views = num_photos + num_frames;
  size.training.num_pixels = scaled(mean * static_cast<double>(num_photos) +
                                    static_cast<double>(num_frames * kVideoFramePixels));
  size.training.max_pixels = scaled(static_cast<double>(size.max_source_pixels));
}

}  // namespace

absl::StatusOr<DatasetSize> SizeOf(std::span<const MeasuredFile> files, int64_t num_segment_masks,
                                   const TrainingSettings& settings) {
  const ImportOptions& import = settings.import;
  DatasetSize size;
  const int64_t num_frames = MeasureVideos(files, settings.sfm.max_video_frames, size);
  size.is_video = NumOfKind(files, FileKind::kImage) == 0;
  if (size.is_video && num_frames == 0) {
    return absl::InvalidArgumentError("the dataset has no photograph");
  }
  MeasurePhotos(files, num_frames, import.image_scale, size);
  size.has_poses = NumOfKind(files, FileKind::kPoses) > 0;
  TrainingSize& counts = size.training;
  const int64_t held_out = NumHeldOut(import, counts.num_views);
  counts.num_training_views = std::max<int64_t>(1, counts.num_views - held_out);
  // The number of views bounds these counts, because names are not matched here.
  if (import.use_masks) counts.num_masked_views = std::min(counts.num_views, num_segment_masks);
  // One ignore mask may apply to all views. Masks without segments are ignore masks.
  if (NumOfKind(files, FileKind::kIgnoreMask) > 0 ||
      num_segment_masks < NumOfKind(files, FileKind::kMask)) {
    counts.num_ignore_views = counts.num_views;
  }
  if (import.use_depth) {
    counts.num_depth_views = std::min(counts.num_views, NumOfKind(files, FileKind::kDepth) +
                                                            NumOfKind(files, FileKind::kDisparity));
  }
  for (const MeasuredFile& file : files) {
    int64_t& most =
        file.file.kind == FileKind::kGaussians ? size.num_given_gaussians : counts.num_points;
    most = std::max(most, file.facts.num_points);
  }
  // Without poses, the stage "sfm" finds the points.
  if (!size.has_poses) counts.num_points = kPointsOfPhoto * counts.num_views;
  return size;
}

}  // namespace pepeseg
