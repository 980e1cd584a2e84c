#include "core/dataset/import.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/base/file_io.h"
#include "core/base/file_name.h"
#include "core/base/status_macros.h"
#include "core/dataset/capture_checks.h"
#include "core/dataset/dataset_index.h"
#include "core/dataset/depth_files.h"
#include "core/dataset/held_out.h"
#include "core/dataset/mask_files.h"
#include "core/dataset/match_poses.h"
#include "core/dataset/photo_poses.h"
#include "core/dataset/view_warp.h"
#include "core/formats/colmap.h"
#include "core/formats/decode_image.h"
#include "core/formats/exif.h"
#include "core/formats/ply.h"
#include "core/scene/camera.h"
#include "core/scene/capture.h"

namespace pepeseg {
namespace {

// Returns the lens scaled to the photograph's size: datasets are often shrunk after their poses
// were found. Returns INVALID_ARGUMENT if the shapes differ by more than a pixel.
absl::StatusOr<Lens> FitLens(const Lens& lens, const Image& photo, const std::string& name) {
  if (photo.width == lens.width && photo.height == lens.height) return lens;
  const double expected_height = static_cast<double>(photo.width) * lens.height / lens.width;
  const double expected_width = static_cast<double>(photo.height) * lens.width / lens.height;
  if (std::abs(photo.height - expected_height) > 1 && std::abs(photo.width - expected_width) > 1) {
    return absl::InvalidArgumentError(absl::StrCat(name, ": ", photo.width, "x", photo.height,
                                                   " pixels, its camera has ", lens.width, "x",
                                                   lens.height));
  }
  return Resized(lens, photo.width, photo.height);
}

struct DecodedPhoto {
  Image image;                       // as stored
  std::vector<uint8_t> transparent;  // see DecodePhoto
  int orientation = 1;               // EXIF orientation
};

absl::StatusOr<DecodedPhoto> ReadPhoto(const DatasetFile& photo) {
  ASSIGN_OR_RETURN(const std::string bytes, ReadFile(photo.path, photo.name, kMaxImageFileBytes));
  const std::span span(reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size());
  DecodedPhoto decoded;
  ASSIGN_OR_RETURN(decoded.image, DecodePhoto(span, photo.name, &decoded.transparent));
  decoded.orientation = ReadExifOrientation(span);
  return decoded;
}

// Reads the masks and the depth map that a view has among the files.
class PriorReader {
 public:
  explicit PriorReader(const DatasetIndex& index) : index_(index) {}

  // Return the priors of the view, or empty ones. `photo` is its photograph, `warp` that
  // photograph's warp.
  absl::StatusOr<MaskSet> ReadMasksOf(const View& view, const PhotoSize& photo,
                                      const ViewWarp& warp) {
    const std::string stem(WithoutSuffix(view.name));
    if (const auto folder = index_.mask_folders.find(stem); folder != index_.mask_folders.end()) {
      ASSIGN_OR_RETURN(const MaskSet set, ReadBinaryMasks(folder->second, photo));
      return warp.Masks(set);
    }
    const auto masks = index_.masks.find(stem);
    if (masks == index_.masks.end()) return MaskSet();
    bool soft = false;
    ASSIGN_OR_RETURN(const MaskSet set,
                     ReadMasks(masks->second->path, masks->second->name, photo, &soft));
    if (soft) soft_.push_back(masks->second->name);
    return warp.Masks(set);
  }

  absl::StatusOr<DepthPrior> ReadDepthOf(const View& view, const PhotoSize& photo,
                                         const ViewWarp& warp) {
    DepthPrior prior;
    const auto found = index_.depth.find(std::string(WithoutSuffix(view.name)));
    if (found == index_.depth.end()) return prior;
    const DatasetFile& file = *found->second;
    prior.kind =
        file.kind == FileKind::kDisparity ? DepthPrior::Kind::kDisparity : DepthPrior::Kind::kDepth;
    ASSIGN_OR_RETURN(const FloatImage map, ReadDepthMap(file.path, file.name, prior.kind, photo));
    // After ReadDepthMap unknown depth is NaN, before and after the warp.
    std::vector<float> depth = warp.Depth(map);
    // Pixels that are not trained on must not influence the percentiles of NormalizeDepth.
    for (size_t i = 0; i < view.ignore.size(); ++i) {
      if (view.ignore[i] != 0) depth[i] = std::numeric_limits<float>::quiet_NaN();
    }
    prior.values = NormalizeDepth(std::move(depth));
    if (prior.values.empty()) without_depth_.push_back(file.name);
    return prior;
  }

  // Adds warnings that name the depth maps without information, and the masks with soft borders.
  void AddWarnings(std::vector<std::string>& warnings) const {
    if (!without_depth_.empty()) {
      warnings.push_back(LeftOut(without_depth_, "depth maps have one value everywhere, or none"));
    }
    if (!soft_.empty()) {
      warnings.push_back(absl::StrCat(
          soft_.size(), " label images are one mask with soft borders each, cut at half of the ",
          "value: ", FirstNames(soft_)));
    }
  }

 private:
  const DatasetIndex& index_;
  std::vector<std::string> without_depth_, soft_;
};

// Reads the views, one after the other.
class ViewReader {
 public:
  ViewReader(const DatasetIndex& index, const PhotoPoses& poses, double image_scale)
      : index_(index), poses_(poses), image_scale_(image_scale), priors_(index) {}

  absl::StatusOr<View> Read(const Match& match) {
    const std::string& name = match.photo->name;
    const auto camera = poses_.lenses.find(match.pose.camera_id);
    if (camera == poses_.lenses.end()) {
      return absl::InvalidArgumentError(
          absl::StrCat(poses_.file, ": image ", match.pose.name, " has the camera ",
                       match.pose.camera_id, ", which ", poses_.camera_file, " does not list"));
    }
    ASSIGN_OR_RETURN(const DecodedPhoto decoded, ReadPhoto(*match.photo));
    const Image& photo = decoded.image;
    ASSIGN_OR_RETURN(const Lens lens, FitLens(camera->second, photo, name));
    num_resized_ += lens.width != camera->second.width ? 1 : 0;
    RETURN_IF_ERROR(PrepareWarp(match.pose.camera_id, lens));
    View view;
    view.name = match.key;
    view.camera = warp_->camera();
    view.cam_from_world = match.pose.cam_from_world;
    view.photo = warp_->Photo(photo);
    view.photograph = warp_->photograph();
    view.photograph->orientation = decoded.orientation;
    if (!decoded.transparent.empty()) view.ignore = warp_->Ignore(decoded.transparent);
    RETURN_IF_ERROR(ReadCompanions(match, {name, photo.width, photo.height}, view));
    return view;
  }

  int num_resized() const { return num_resized_; }
  const PriorReader& priors() const { return priors_; }

 private:
  // Sets warp_ to the warp of the camera. Only the last one is kept, because a warp is as large as
  // a photograph; views of one camera mostly follow each other.
  absl::Status PrepareWarp(uint32_t camera_id, const Lens& lens) {
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

  absl::Status ReadCompanions(const Match& match, const PhotoSize& photo, View& view) {
    const std::string stem(WithoutSuffix(match.key));
    ASSIGN_OR_RETURN(view.masks, priors_.ReadMasksOf(view, photo, *warp_));
    // A pixel is ignored if it is transparent, or if the mask for all views or the view's own says
    // so.
    const auto own = index_.ignore.find(stem);
    std::vector<const DatasetFile*> ignore;
    if (index_.ignore_all != nullptr) ignore.push_back(index_.ignore_all);
    if (own != index_.ignore.end()) ignore.push_back(own->second);
    const auto keep = index_.keep.find(stem);
    if (keep != index_.keep.end()) ignore.push_back(keep->second);
    for (const DatasetFile* file : ignore) {
      ASSIGN_OR_RETURN(std::vector<uint8_t> mask, ReadIgnoreMask(file->path, file->name, photo));
      if (keep != index_.keep.end() && file == keep->second) {
        for (uint8_t& ignored : mask) ignored = ignored == 0 ? 1 : 0;
      }
      const std::vector<uint8_t> warped = warp_->Ignore(mask);
      view.ignore.resize(warped.size(), 0);
      for (size_t i = 0; i < warped.size(); ++i) view.ignore[i] |= warped[i];
    }
    ASSIGN_OR_RETURN(view.depth, priors_.ReadDepthOf(view, photo, *warp_));
    return absl::OkStatus();
  }

  const DatasetIndex& index_;
  const PhotoPoses& poses_;
  double image_scale_;
  int num_resized_ = 0;
  PriorReader priors_;
  std::optional<ViewWarp> warp_;
  uint32_t warp_camera_ = 0;
  Lens warp_lens_;
};

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
  }
  index.warnings.insert(index.warnings.end(), warnings.begin(), warnings.end());
  return absl::OkStatus();
}

}  // namespace

absl::Status Validate(const ImportOptions& options) {
  if (!(options.image_scale > 0 && options.image_scale <= 1)) {
    return absl::InvalidArgumentError(
        absl::StrCat("image_scale is ", options.image_scale, ", it must be in (0, 1]"));
  }
  if (options.held_out_every < 0 || options.held_out_every == 1) {
    return absl::InvalidArgumentError(
        absl::StrCat("held_out_every is ", options.held_out_every, ", it must be 0, or 2 or more"));
  }
  if (options.held_out_views.size() > kMaxHeldOutViews) {
    return absl::InvalidArgumentError(absl::StrCat("held_out_views has ",
                                                   options.held_out_views.size(),
                                                   " names, the limit is ", kMaxHeldOutViews));
  }
  return absl::OkStatus();
}

absl::StatusOr<Capture> ImportCapture(std::span<const DatasetFile> files,
                                      const ImportOptions& options) {
  RETURN_IF_ERROR(Validate(options));
  ASSIGN_OR_RETURN(DatasetIndex index, IndexDataset(files));
  std::vector<std::string> photographs;
  for (const auto& [key, photo] : index.photos) photographs.push_back(key);
  RETURN_IF_ERROR(CheckHeldOutViews(options, photographs));
  ASSIGN_OR_RETURN(const PhotoPoses poses, ReadPhotoPoses(index));
  for (const std::string& warning : poses.warnings) index.warnings.push_back(warning);
  ASSIGN_OR_RETURN(std::vector<Match> matches, MatchPoses(poses, index));
  // One view has no parallax, so nothing could be reconstructed.
  if (matches.size() < 2) {
    return absl::InvalidArgumentError(
        absl::StrCat(matches.size(), " of ", index.photos.size(), " photographs have a pose in ",
                     poses.file, " (", poses.photos.size(), " poses); at least 2 are needed"));
  }
  std::vector<std::string> keys;
  for (const Match& match : matches) keys.push_back(match.key);
  RETURN_IF_ERROR(CheckCompanions(keys, index.masks, "mask files", index.warnings));
  RETURN_IF_ERROR(CheckCompanions(keys, index.ignore, "ignore masks", index.warnings));
  RETURN_IF_ERROR(CheckCompanions(keys, index.depth, "depth maps", index.warnings));
  Capture capture;
  RETURN_IF_ERROR(PlaceScene(index, poses, matches, capture));
  ViewReader reader(index, poses, options.image_scale);
  for (const Match& match : matches) {
    ASSIGN_OR_RETURN(View view, reader.Read(match));
    // Counted among the views that have a pose.
    view.held_out = IsHeldOut(options, view.name, capture.views.size());
    capture.views.push_back(std::move(view));
  }
  capture.warnings = std::move(index.warnings);
  if (auto warning = WarnOfIgnoredScene(capture)) capture.warnings.push_back(*std::move(warning));
  reader.priors().AddWarnings(capture.warnings);
  if (reader.num_resized() > 0) {
    capture.warnings.push_back(absl::StrCat(
        reader.num_resized(), " photographs have another size than their cameras, which ",
        "were scaled to fit"));
  }
  return capture;
}

absl::StatusOr<std::vector<std::string>> ImportPriors(std::span<const DatasetFile> files,
                                                      Capture& capture) {
  std::vector<std::string> keys, warnings;
  for (const View& view : capture.views) keys.push_back(view.name);
  ASSIGN_OR_RETURN(const DatasetIndex index, IndexPriors(files, keys));
  RETURN_IF_ERROR(CheckCompanions(keys, index.masks, "mask files", warnings));
  RETURN_IF_ERROR(CheckCompanions(keys, index.depth, "depth maps", warnings));
  PriorReader reader(index);
  std::vector<MaskSet> masks;
  std::vector<DepthPrior> depths;
  std::optional<ViewWarp> warp;  // that of `warped`; most views have the same lens
  const View* warped = nullptr;
  for (const View& view : capture.views) {
    // Every imported view has a photograph.
    if (!warp || *warped->photograph != *view.photograph || warped->camera != view.camera) {
      warp = ViewWarp::Restore(*view.photograph, view.camera);
      warped = &view;
    }
    const Lens& lens = view.photograph->lens;
    const PhotoSize photo{view.name, lens.width, lens.height};
    ASSIGN_OR_RETURN(MaskSet mask_set, reader.ReadMasksOf(view, photo, *warp));
    ASSIGN_OR_RETURN(DepthPrior depth, reader.ReadDepthOf(view, photo, *warp));
    masks.push_back(std::move(mask_set));
    depths.push_back(std::move(depth));
  }
  // Nothing can fail from here on, so the capture is changed completely or not at all.
  for (size_t i = 0; i < capture.views.size(); ++i) {
    View& view = capture.views[i];
    if (!masks[i].empty()) view.masks = std::move(masks[i]);
    if (!depths[i].values.empty()) view.depth = std::move(depths[i]);
  }
  reader.AddWarnings(warnings);
  return warnings;
}

}  // namespace pepeseg
