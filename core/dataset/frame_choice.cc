#include "core/dataset/frame_choice.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/errors.h"
#include "core/base/file_name.h"
#include "core/base/status_macros.h"
#include "core/dataset/capture_checks.h"
#include "core/dataset/depth_checks.h"
#include "core/dataset/photo_file.h"
#include "core/dataset/pixel_frame.h"
#include "core/formats/images.h"

namespace pepeseg {
namespace {

constexpr size_t kFewestColours = 100;  // projections of points, over all examined photographs

// A photograph whose two frames have the same shape.
struct Examined {
  std::string key;
  const DatasetFile* file = nullptr;
  PhotoFacts facts;
};

CameraPixels StoredPixels(const Examined& photo) {
  return {{photo.file->name, photo.facts.width, photo.facts.height},
          photo.facts.orientation,
          PixelFrame::kStored};
}

// Returns at most kMaxExaminedPhotos elements, evenly spread.
template <class T>
std::vector<T> Spread(std::vector<T> all) {
  const size_t step =
      std::max<size_t>(1, (all.size() + kMaxExaminedPhotos - 1) / kMaxExaminedPhotos);
  std::vector<T> some;
  for (size_t i = 0; i < all.size(); i += step) some.push_back(std::move(all[i]));
  return some;
}

// Returns what the photograph has of a kind as values of its stored shape; empty: nothing.
absl::StatusOr<FloatImage> ValuesOf(Companion kind, const Examined& photo,
                                    const CompanionFiles& files) {
  const std::string stem(WithoutSuffix(photo.key));
  const CameraPixels pixels = StoredPixels(photo);
  FloatImage values{photo.facts.width, photo.facts.height, {}};
  if (kind == Companion::kDepth) {
    ASSIGN_OR_RETURN(FloatImage map, files.Depth(stem, pixels));
    map.values = NormalizeDepth(std::move(map.values));
    return map.values.empty() ? FloatImage() : map;
  }
  if (kind == Companion::kMasks) {
    ASSIGN_OR_RETURN(const MaskSet masks, files.Masks(stem, pixels));
    values.values.assign(masks.pixel_cell.begin(), masks.pixel_cell.end());
  } else {
    ASSIGN_OR_RETURN(const std::vector<uint8_t> ignored, files.Ignored(stem, pixels));
    values.values.assign(ignored.begin(), ignored.end());
  }
  return values;
}

// Lists the photographs whose two frames have the same shape.
std::vector<Examined> AlikePhotos(const DatasetIndex& index, const PhotoFactsByKey& facts) {
  std::vector<Examined> alike;
  for (const auto& [key, of] : facts) {
    const Examined photo{key, index.photos.at(key), of};
    if (of.orientation != 1 && StoredPixels(photo).FramesAlike()) alike.push_back(photo);
  }
  return alike;
}

// Decides one kind; nullopt: no photograph has it, or both frames give the same.
absl::StatusOr<std::optional<PixelFrame>> ChooseFrame(Companion kind, const DatasetIndex& index,
                                                      std::vector<Examined> alike) {
  const CompanionFiles files(index);
  std::erase_if(alike, [&](const Examined& photo) {
    return files.FileOf(kind, std::string(WithoutSuffix(photo.key))) == nullptr;
  });
  alike = Spread(std::move(alike));
  FrameTrial trial(kind == Companion::kDepth ? FrameTrial::Values::kDepth
                                             : FrameTrial::Values::kLabels);
  for (const Examined& photo : alike) {
    ASSIGN_OR_RETURN(const FloatImage values, ValuesOf(kind, photo, files));
    if (values.values.empty()) continue;
    ASSIGN_OR_RETURN(const DecodedPhoto decoded, ReadPhoto(*photo.file));
    trial.Add(decoded.image, decoded.orientation, values);
  }
  if (trial.NeedsNoChoice()) return std::optional<PixelFrame>();
  if (const auto verdict = trial.Verdict(kClearlyMore)) return verdict;
  const Examined& first = alike.front();
  return Refused(
      files.FileOf(kind, std::string(WithoutSuffix(first.key)))->name,
      absl::StrCat("its borders fit the stored and the upright pixels of ", first.file->name,
                   ", which has the EXIF orientation ", first.facts.orientation,
                   ", alike. Save the photographs upright and without the tag, and make these "
                   "files for them"));
}

// Returns the sum of the differences between the colours of points and those of the photograph,
// where a camera of its size sees them. Adds the number of these points to `num`.
double ColourDifference(const Image& photo, const PosedLens& camera,
                        std::span<const ScenePoint> points, size_t& num) {
  constexpr size_t kMostPoints = 2000;
  const size_t step = std::max<size_t>(1, (points.size() + kMostPoints - 1) / kMostPoints);
  double sum = 0;
  for (size_t i = 0; i < points.size(); i += step) {
    const auto at = Project(camera, points[i].position.cast<double>());
    if (!at) continue;
    const size_t pixel = static_cast<size_t>(at->y()) * photo.width + static_cast<size_t>(at->x());
    for (size_t c = 0; c < 3; ++c) sum += std::abs(points[i].rgb[c] - photo.pixels[3 * pixel + c]);
    ++num;
  }
  return sum;
}

// Returns the frame whose photographs have the colours of the points, or nothing.
absl::StatusOr<std::optional<PixelFrame>> FrameByColours(const PhotoPoses& poses,
                                                         std::span<const Match> alike,
                                                         std::span<const ScenePoint> points) {
  double stored_sum = 0, upright_sum = 0;
  size_t num_stored = 0, num_upright = 0;
  for (const Match& match : alike) {
    ASSIGN_OR_RETURN(const DecodedPhoto photo, ReadPhoto(*match.photo));
    const Image stored = ShrunkTo(photo.image, kExaminedSide);
    const Image upright = Upright(stored, photo.orientation);
    const Lens& lens = poses.lenses.at(match.pose.camera_id);
    const auto difference = [&](const Image& image, size_t& num) {
      const PosedLens camera = {Resized(lens, image.width, image.height),
                                match.pose.cam_from_world};
      return ColourDifference(image, camera, points, num);
    };
    stored_sum += difference(stored, num_stored);
    upright_sum += difference(upright, num_upright);
  }
  if (std::min(num_stored, num_upright) < kFewestColours) return std::optional<PixelFrame>();
  const double in_stored = stored_sum / static_cast<double>(num_stored);
  const double in_upright = upright_sum / static_cast<double>(num_upright);
  if (in_upright > kClearlyMore * in_stored) return std::optional(PixelFrame::kStored);
  if (in_stored > kClearlyMore * in_upright) return std::optional(PixelFrame::kUpright);
  return std::optional<PixelFrame>();
}

}  // namespace

absl::StatusOr<CompanionFrames> ChooseCompanionFrames(const DatasetIndex& index,
                                                      const PhotoFactsByKey& facts,
                                                      const std::set<Companion>& kinds) {
  CompanionFrames frames;
  const std::vector<Examined> alike = AlikePhotos(index, facts);
  for (const Companion kind : kinds) {
    ASSIGN_OR_RETURN(const std::optional<PixelFrame> frame, ChooseFrame(kind, index, alike));
    if (frame) frames[kind] = *frame;
  }
  return frames;
}

absl::StatusOr<std::optional<PixelFrame>> DepthFrameByPoints(
    const DatasetIndex& index, const PhotoPoses& poses, std::span<const Match> matches,
    const PhotoFactsByKey& facts, PixelFrame cameras, std::span<const ScenePoint> points) {
  constexpr double kClearlyHigher = 0.15, kClear = 0.3;  // correlations
  const CompanionFiles files_stored(index),
      files_upright(index, {{Companion::kDepth, PixelFrame::kUpright}});
  std::vector<std::pair<Match, FittedCamera>> alike;
  for (const Match& match : matches) {
    const std::string stem(WithoutSuffix(match.key));
    if (files_stored.FileOf(Companion::kDepth, stem) == nullptr) continue;
    const auto lens = poses.lenses.find(match.pose.camera_id);
    if (lens == poses.lenses.end()) continue;  // reported by the import
    const PhotoFacts& photo = facts.at(match.key);
    if (photo.orientation == 1) continue;
    ASSIGN_OR_RETURN(const FittedCamera camera,
                     FitCamera(lens->second, photo, cameras, match.photo->name));
    if (camera.pixels.FramesAlike()) alike.emplace_back(match, camera);
  }
  double stored_sum = 0, upright_sum = 0;
  int num = 0;
  for (const auto& [match, camera] : Spread(std::move(alike))) {
    const std::string stem(WithoutSuffix(match.key));
    ASSIGN_OR_RETURN(const FloatImage stored, files_stored.Depth(stem, camera.pixels));
    ASSIGN_OR_RETURN(const FloatImage upright, files_upright.Depth(stem, camera.pixels));
    const PosedLens posed = {camera.lens, match.pose.cam_from_world};
    const auto in_stored = DepthCorrelation(stored, posed, points);
    const auto in_upright = DepthCorrelation(upright, posed, points);
    if (!in_stored || !in_upright) continue;
    // Positive if the values are what their folder says.
    const bool is_disparity =
        files_stored.FileOf(Companion::kDepth, stem)->kind == FileKind::kDisparity;
    stored_sum += is_disparity ? -*in_stored : *in_stored;
    upright_sum += is_disparity ? -*in_upright : *in_upright;
    ++num;
  }
  if (num == 0) return std::optional<PixelFrame>();
  // A correlation may have either sign, because depth/ may hold disparity.
  const double difference = (std::abs(stored_sum) - std::abs(upright_sum)) / num;
  if (std::abs(difference) >= kClearlyHigher) {
    return std::optional(difference > 0 ? PixelFrame::kStored : PixelFrame::kUpright);
  }
  // A floor that is turned round looks like its disparity: then the folder's name counts.
  if (std::abs(stored_sum - upright_sum) / num < 2 * kClear) return std::optional<PixelFrame>();
  return std::optional(stored_sum > upright_sum ? PixelFrame::kStored : PixelFrame::kUpright);
}

absl::StatusOr<PixelFrame> ChooseCameraFrame(const PhotoPoses& poses,
                                             std::span<const Match> matches,
                                             const PhotoFactsByKey& facts,
                                             std::span<const ScenePoint> points,
                                             DatasetIndex& index) {
  std::vector<Match> alike;
  for (const Match& match : matches) {
    if (!poses.lenses.contains(match.pose.camera_id)) continue;  // reported by the import
    const PhotoFacts& photo = facts.at(match.key);
    if (photo.orientation == 1) continue;
    if (!StoredPixels({match.key, match.photo, photo}).FramesAlike()) continue;
    alike.push_back(match);
  }
  if (alike.empty()) return PixelFrame::kStored;
  const size_t num_alike = alike.size();
  alike = Spread(std::move(alike));
  ASSIGN_OR_RETURN(const std::optional<PixelFrame> frame, FrameByColours(poses, alike, points));
  const std::string what =
      absl::StrCat(num_alike, " photographs have an EXIF orientation, and their sizes do not show ",
                   "whether their cameras are of the stored or of the upright pixels (",
                   alike.front().photo->name, ": ", facts.at(alike.front().key).orientation, ")");
  if (frame) {
    index.warnings.push_back(absl::StrCat(
        poses.file, ": ", what, "; the colours of the points fit the ", NameOf(*frame), " pixels"));
    return *frame;
  }
  if (index.pose_format != PoseFormat::kColmap) {
    return Refused(poses.file, absl::StrCat(what,
                                            ", and there are no coloured points that decide. "
                                            "Save the photographs as the cameras see them, "
                                            "without the tag"));
  }
  index.warnings.push_back(absl::StrCat(poses.file, ": ", what,
                                        "; they are taken as those of the stored pixels, which "
                                        "COLMAP reads"));
  return PixelFrame::kStored;
}

}  // namespace pepeseg
