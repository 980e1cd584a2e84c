#include "core/dataset/view_reader.h"

#include <algorithm>
#include <atomic>
#include <limits>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/file_name.h"
#include "core/base/num_threads.h"
#include "core/base/status_macros.h"
#include "core/dataset/photo_file.h"
#include "kernels/thread_pool.h"

namespace pepeseg {

namespace {

// Returns the prior of the view for a map of its photograph; an empty one for an empty map or one
// without information. `file` is the map's, null without one.
DepthPrior DepthOfView(const DatasetFile* file, const FloatImage& map, const View& view,
                       const ViewWarp& warp, ReadingNotes& notes) {
  DepthPrior prior;
  if (file == nullptr) return prior;
  prior.kind =
      file->kind == FileKind::kDisparity ? DepthPrior::Kind::kDisparity : DepthPrior::Kind::kDepth;
  // Unknown depth is NaN, before and after the warp.
  std::vector<float> depth = warp.Depth(map);
  // Pixels that are not trained on must not influence the percentiles of NormalizeDepth.
  for (size_t i = 0; i < view.ignore.size(); ++i) {
    if (view.ignore[i] != 0) depth[i] = std::numeric_limits<float>::quiet_NaN();
  }
  prior.values = NormalizeDepth(std::move(depth));
  if (prior.values.empty()) notes.without_depth.insert(file->name);
  return prior;
}

}  // namespace

absl::StatusOr<ViewPriors> ReadPriors(const View& view, const CameraPixels& pixels,
                                      const ViewWarp& warp, const CompanionFiles& files,
                                      ReadingNotes& notes) {
  const std::string stem(WithoutSuffix(view.name));
  ViewPriors priors;
  ASSIGN_OR_RETURN(const MaskSet masks, files.Masks(stem, pixels, &notes));
  if (files.FileOf(Companion::kMasks, stem) != nullptr) priors.masks = warp.Masks(masks);
  ASSIGN_OR_RETURN(const FloatImage map, files.Depth(stem, pixels, &notes));
  priors.depth = DepthOfView(files.FileOf(Companion::kDepth, stem), map, view, warp, notes);
  return priors;
}

int NumReaders(int64_t max_pixels, int num_threads) {
  constexpr int64_t kMostPixels = 128'000'000;  // decoded at once
  return static_cast<int>(std::clamp<int64_t>(kMostPixels / std::max<int64_t>(1, max_pixels), 1,
                                              NumThreads(num_threads)));
}

absl::Status ReadEach(size_t count, int num_readers,
                      absl::FunctionRef<absl::Status(size_t i, int reader)> read) {
  std::vector<absl::Status> results(count);
  std::atomic<size_t> first_failed = count;
  ThreadPool pool(num_readers);
  pool.ParallelFor(static_cast<int64_t>(count), [&](int64_t task, int reader) {
    const auto i = static_cast<size_t>(task);
    if (i > first_failed) return;
    results[i] = read(i, reader);
    if (results[i].ok()) return;
    for (size_t first = first_failed; i < first;) {
      if (first_failed.compare_exchange_weak(first, i)) break;
    }
  });
  return first_failed < count ? results[first_failed] : absl::OkStatus();
}

ViewReader::ViewReader(const DatasetIndex& index, const PhotoPoses& poses, DatasetFrames frames,
                       double image_scale)
    : poses_(poses),
      camera_frame_(frames.cameras),
      image_scale_(image_scale),
      files_(index, std::move(frames.companions)) {}

absl::StatusOr<View> ViewReader::Read(const Match& match) {
  const auto camera = poses_.lenses.find(match.pose.camera_id);
  if (camera == poses_.lenses.end()) {
    return absl::InvalidArgumentError(
        absl::StrCat(poses_.file, ": image ", match.pose.name, " has the camera ",
                     match.pose.camera_id, ", which ", poses_.camera_file, " does not list"));
  }
  ASSIGN_OR_RETURN(DecodedPhoto photo, ReadPhoto(*match.photo));
  const PhotoFacts facts{photo.image.width, photo.image.height, photo.orientation};
  ASSIGN_OR_RETURN(const FittedCamera fitted,
                   FitCamera(camera->second, facts, camera_frame_, match.photo->name));
  notes_.num_resized += fitted.lens.width != camera->second.width ? 1 : 0;
  if (fitted.pixels.frame == PixelFrame::kUpright) {
    // The upright pixels become the stored ones of the view.
    notes_.turned.insert(match.photo->name);
    photo = Upright(std::move(photo));
  }
  RETURN_IF_ERROR(PrepareWarp(match.pose.camera_id, fitted.lens));
  View view;
  view.name = match.key;
  view.camera = warp_->camera();
  view.cam_from_world = match.pose.cam_from_world;
  view.photo = warp_->Photo(photo.image);
  view.photograph = warp_->photograph();
  view.photograph->orientation = photo.orientation;
  if (!photo.transparent.empty()) view.ignore = warp_->Ignore(photo.transparent);
  RETURN_IF_ERROR(ReadCompanions(fitted.pixels, view));
  return view;
}

// Sets warp_ to the warp of the camera. Only the last one is kept, because a warp is as large as
// a photograph; views of one camera mostly follow each other.
absl::Status ViewReader::PrepareWarp(uint32_t camera_id, const Lens& lens) {
  if (warp_ && warp_camera_ == camera_id && warp_lens_.width == lens.width &&
      warp_lens_.height == lens.height) {
    return absl::OkStatus();
  }
  absl::StatusOr<ViewWarp> warp = ViewWarp::Create(lens, image_scale_);
  if (!warp.ok()) {
    return absl::InvalidArgumentError(
        absl::StrCat(poses_.camera_file, ": camera ", camera_id, ": ", warp.status().message()));
  }
  warp_ = std::move(warp).value();
  warp_camera_ = camera_id;
  warp_lens_ = lens;
  return absl::OkStatus();
}

absl::Status ViewReader::ReadCompanions(const CameraPixels& pixels, View& view) {
  const std::string stem(WithoutSuffix(view.name));
  ASSIGN_OR_RETURN(const std::vector<uint8_t> ignored, files_.Ignored(stem, pixels, &notes_));
  if (!ignored.empty()) {
    // Transparent pixels are ignored already.
    const std::vector<uint8_t> warped = warp_->Ignore(ignored);
    view.ignore.resize(warped.size(), 0);
    for (size_t i = 0; i < warped.size(); ++i) view.ignore[i] |= warped[i];
  }
  ASSIGN_OR_RETURN(ViewPriors priors, ReadPriors(view, pixels, *warp_, files_, notes_));
  view.masks = std::move(priors.masks);
  view.depth = std::move(priors.depth);
  return absl::OkStatus();
}

}  // namespace pepeseg
