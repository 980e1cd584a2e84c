#include "core/dataset/import.h"

#include <algorithm>
#include <limits>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/base/status_macros.h"
#include "core/dataset/capture_checks.h"
#include "core/dataset/companion_files.h"
#include "core/dataset/dataset_index.h"
#include "core/dataset/depth_checks.h"
#include "core/dataset/frame_choice.h"
#include "core/dataset/match_poses.h"
#include "core/dataset/photo_file.h"
#include "core/dataset/photo_poses.h"
#include "core/dataset/view_reader.h"
#include "core/dataset/view_warp.h"
#include "core/formats/colmap.h"
#include "core/formats/ply.h"
#include "core/scene/camera.h"
#include "core/scene/capture.h"

namespace pepeseg {
namespace {

// Reads the initial points: of the point cloud if there is one, else of the COLMAP model.
absl::StatusOr<std::vector<ScenePoint>> ReadPoints(const DatasetIndex& index,
                                                   const PhotoPoses& poses,
                                                   const Eigen::Vector3d& origin) {
  if (index.ply_points != nullptr) {
    return ReadPlyPoints(index.ply_points->path, index.ply_points->name, origin);
  }
  if (poses.points != nullptr) {
    return ReadColmapPoints(poses.points->path, poses.points->name, origin);
  }
  return std::vector<ScenePoint>();
}

// Returns the origin of the cameras. If it is not zero, makes the poses relative to it and warns.
Eigen::Vector3d TakeOrigin(std::vector<Match>& matches, std::vector<std::string>& warnings) {
  std::vector<Pose> poses;
  poses.reserve(matches.size());
  for (const Match& match : matches) poses.push_back(match.pose.cam_from_world);
  const Eigen::Vector3d origin = OriginOf(poses);
  if (origin.isZero(0)) return origin;
  for (Match& match : matches) {
    match.pose.cam_from_world = RelativeTo(origin, match.pose.cam_from_world);
  }
  warnings.push_back(absl::StrCat(
      "the cameras are far from zero compared with the distances between ",
      "them: coordinates are relative to (", origin.x(), ", ", origin.y(), ", ", origin.z(), ")"));
  return origin;
}

// Sets the origin and the points of the capture, and makes the poses relative to the origin.
// Corrects poses that were written in another convention than their format's, and warns of it.
absl::Status PlaceScene(DatasetIndex& index, const PhotoPoses& poses, std::vector<Match>& matches,
                        Capture& capture) {
  std::vector<Match> as_written = matches;
  std::vector<std::string> warnings;
  const auto place = [&]() -> absl::StatusOr<std::vector<PosedLens>> {
    warnings.clear();
    // The origin comes first, because points and poses are stored relative to it.
    capture.origin = TakeOrigin(matches, warnings);
    ASSIGN_OR_RETURN(capture.points, ReadPoints(index, poses, capture.origin));
    std::vector<PosedLens> cameras;
    for (const Match& match : matches) {
      const auto lens = poses.lenses.find(match.pose.camera_id);
      if (lens != poses.lenses.end()) cameras.push_back({lens->second, match.pose.cam_from_world});
    }
    return cameras;
  };
  ASSIGN_OR_RETURN(std::vector<PosedLens> cameras, place());
  if (const auto fits = FindConvention(index.pose_format, cameras, capture.points)) {
    for (Match& match : as_written) {
      match.pose.cam_from_world = fits->corrected(match.pose.cam_from_world);
    }
    matches = std::move(as_written);
    ASSIGN_OR_RETURN(cameras, place());
    index.warnings.push_back(absl::StrFormat(
        "%s: the poses are in another convention than the format's. As written, a camera sees "
        "%.0f %% of the points; with %s it sees %.0f %%. They are read so",
        poses.file, 100 * fits->as_written, fits->name, 100 * fits->seen));
  } else if (auto warning = WarnOfUnseenPoints(cameras, capture.points)) {
    index.warnings.push_back(absl::StrCat(poses.file, ": ", *warning));
  } else if (auto turned = WarnOfAxesTurnedAway(index.pose_format, cameras, capture.points)) {
    index.warnings.push_back(absl::StrCat(poses.file, ": ", *turned));
  }
  index.warnings.insert(index.warnings.end(), warnings.begin(), warnings.end());
  return absl::OkStatus();
}

// Removes masks and depth maps that the options leave out, and warns of them.
void LeaveOutPriors(const ImportOptions& options, DatasetIndex& index) {
  const size_t num_masks = index.masks.size() + index.mask_folders.size();
  if (!options.use_masks && num_masks > 0) {
    index.warnings.push_back(absl::StrCat("the masks of ", num_masks,
                                          " photographs are left out: import.use_masks is false"));
    index.masks.clear();
    index.mask_folders.clear();
  }
  if (!options.use_depth && !index.depth.empty()) {
    index.warnings.push_back(absl::StrCat("the depth maps of ", index.depth.size(),
                                          " photographs are left out: import.use_depth is false"));
    index.depth.clear();
  }
}

absl::StatusOr<PhotoFactsByKey> ReadFacts(std::span<const Match> matches) {
  PhotoFactsByKey facts;
  for (const Match& match : matches) {
    ASSIGN_OR_RETURN(facts[match.key], ReadPhotoFacts(*match.photo));
  }
  return facts;
}

int64_t MostPixels(const PhotoFactsByKey& facts) {
  int64_t most = 0;
  for (const auto& [key, photo] : facts) most = std::max(most, int64_t{photo.width} * photo.height);
  return most;
}

// Chooses the frames of the files whose sizes fit both. Poses and points are relative to the
// origin.
absl::StatusOr<DatasetFrames> ChooseFrames(const PhotoPoses& poses, std::span<const Match> matches,
                                           const PhotoFactsByKey& facts,
                                           std::span<const ScenePoint> points,
                                           DatasetIndex& index) {
  DatasetFrames frames;
  ASSIGN_OR_RETURN(frames.cameras, ChooseCameraFrame(poses, matches, facts, points, index));
  std::set<Companion> kinds = {Companion::kMasks, Companion::kIgnore, Companion::kDepth};
  ASSIGN_OR_RETURN(const std::optional<PixelFrame> depth,
                   DepthFrameByPoints(index, poses, matches, facts, frames.cameras, points));
  if (depth) kinds.erase(Companion::kDepth);
  ASSIGN_OR_RETURN(frames.companions, ChooseCompanionFrames(index, facts, kinds));
  if (depth) frames.companions[Companion::kDepth] = *depth;
  return frames;
}

// Returns a name that the poses have and one that a photograph has, for an error about poses that
// match hardly any; "" if there are none.
std::string NamesOfBoth(const PhotoPoses& poses, const DatasetIndex& index) {
  if (poses.photos.empty() || index.photos.empty()) return "";
  return absl::StrCat(". A pose is of \"", poses.photos.front().name, "\", a photograph is \"",
                      index.photos.begin()->first, "\"");
}

bool IsIgnoredWhole(const View& view) {
  return !view.ignore.empty() &&
         std::ranges::all_of(view.ignore, [](uint8_t value) { return value != 0; });
}

// Reads the views of the matches on several threads.
absl::StatusOr<std::vector<View>> ReadViews(std::span<const Match> matches, int num_readers,
                                            const ViewReader& first, ReadingNotes& notes) {
  std::vector<ViewReader> readers(num_readers, first);
  std::vector<View> views(matches.size());
  RETURN_IF_ERROR(ReadEach(matches.size(), num_readers, [&](size_t i, int reader) -> absl::Status {
    ASSIGN_OR_RETURN(views[i], readers[reader].Read(matches[i]));
    return absl::OkStatus();
  }));
  for (const ViewReader& reader : readers) notes.Merge(reader.notes());
  return views;
}

// Gives the views to the capture, and says which are held out. Photographs that are ignored as a
// whole are left out, with a warning.
absl::Status TakeViews(std::vector<View> views, const ImportOptions& options, Capture& capture,
                       std::vector<std::string>& warnings) {
  const size_t num_views = views.size();
  std::vector<std::string> ignored;
  for (View& view : views) {
    // Counted among the views that have a pose.
    view.held_out = IsHeldOut(options, view.name, capture.views.size());
    if (IsIgnoredWhole(view)) {
      ignored.push_back(view.name);
    } else {
      capture.views.push_back(std::move(view));
    }
  }
  if (capture.views.size() < 2) {
    return absl::InvalidArgumentError(
        absl::StrCat("all pixels of ", ignored.size(), " of ", num_views,
                     " photographs are ignored; at least 2 must show something. In ignore/ what is "
                     "not 0 is left "
                     "out; in masks that transforms.json names (mask_path), what is 0: ",
                     FirstNames(ignored)));
  }
  if (!ignored.empty()) {
    warnings.push_back(LeftOut(ignored, "photographs are ignored as a whole"));
  }
  return absl::OkStatus();
}

}  // namespace

void VisitOptions(ImportOptions& o, OptionVisitor visit) {
  constexpr size_t kMaxHeldOutViews = 10'000;
  visit({"image_scale", &o.image_scale, Range{.low = 0, .high = 1, .open = true}});
  // 1 would leave no view to train on.
  visit({"held_out_every", &o.held_out_every,
         Range{.low = 2, .high = std::numeric_limits<int>::max(), .also = 0}});
  visit({"held_out_views", NamesField{&o.held_out_views, kMaxHeldOutViews}});
  visit({"use_masks", &o.use_masks});
  visit({"use_depth", &o.use_depth});
}

absl::Status Validate(const ImportOptions& options) { return CheckOptions(options); }

absl::StatusOr<Capture> ImportCapture(std::span<const DatasetFile> files,
                                      const ImportOptions& options, int num_threads) {
  RETURN_IF_ERROR(Validate(options));
  ASSIGN_OR_RETURN(DatasetIndex index, IndexDataset(files));
  LeaveOutPriors(options, index);
  std::vector<std::string> photographs;
  for (const auto& [key, photo] : index.photos) photographs.push_back(key);
  RETURN_IF_ERROR(CheckHeldOutViews(options, photographs));
  ASSIGN_OR_RETURN(const PhotoPoses poses, ReadPhotoPoses(index));
  for (const std::string& warning : poses.warnings) index.warnings.push_back(warning);
  ASSIGN_OR_RETURN(std::vector<Match> matches, MatchPoses(poses, index));
  // One view has no parallax, so nothing could be reconstructed.
  if (matches.size() < 2) {
    return absl::InvalidArgumentError(absl::StrCat(
        matches.size(), " of ", index.photos.size(), " photographs have a pose in ", poses.file,
        " (", poses.photos.size(), " poses); at least 2 are needed", NamesOfBoth(poses, index)));
  }
  std::vector<std::string> keys;
  for (const Match& match : matches) keys.push_back(match.key);
  RETURN_IF_ERROR(CheckCompanions(keys, index.masks, "mask files", index.warnings));
  RETURN_IF_ERROR(CheckCompanions(keys, index.ignore, "ignore masks", index.warnings));
  RETURN_IF_ERROR(CheckCompanions(keys, index.depth, "depth maps", index.warnings));
  Capture capture;
  RETURN_IF_ERROR(PlaceScene(index, poses, matches, capture));
  ASSIGN_OR_RETURN(const PhotoFactsByKey facts, ReadFacts(matches));
  ASSIGN_OR_RETURN(DatasetFrames frames,
                   ChooseFrames(poses, matches, facts, capture.points, index));
  ReadingNotes notes;
  ASSIGN_OR_RETURN(
      std::vector<View> read,
      ReadViews(matches, NumReaders(MostPixels(facts), num_threads),
                ViewReader(index, poses, std::move(frames), options.image_scale), notes));
  RETURN_IF_ERROR(TakeViews(std::move(read), options, capture, index.warnings));
  capture.warnings = std::move(index.warnings);
  const bool has_ignore_masks =
      index.ignore_all != nullptr || !index.ignore.empty() || !index.keep.empty();
  if (auto warning = WarnOfIgnoredScene(capture, has_ignore_masks)) {
    capture.warnings.push_back(*std::move(warning));
  }
  for (auto& warning : {WarnOfKeepMasks(capture), WarnOfDarkPhotographs(capture)}) {
    if (warning) capture.warnings.push_back(*warning);
  }
  notes.AddWarnings(capture.warnings);
  std::vector<View*> views;
  for (View& view : capture.views) views.push_back(&view);
  for (std::string& warning : CorrectDepthKinds(views, capture.points)) {
    capture.warnings.push_back(std::move(warning));
  }
  return capture;
}

}  // namespace pepeseg
