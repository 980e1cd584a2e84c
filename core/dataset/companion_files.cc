#include "core/dataset/companion_files.h"

#include <algorithm>
#include <cstdlib>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/dataset/depth_files.h"
#include "core/dataset/match_poses.h"
#include "core/dataset/photo_poses.h"

namespace pepeseg {
namespace {

constexpr int kFirstTransposed = 5;  // EXIF orientations from here on exchange the sides

PixelFrame Other(PixelFrame frame) {
  return frame == PixelFrame::kStored ? PixelFrame::kUpright : PixelFrame::kStored;
}

const DatasetFile* Find(const std::map<std::string, const DatasetFile*>& files,
                        const std::string& stem) {
  const auto found = files.find(stem);
  return found == files.end() ? nullptr : found->second;
}

}  // namespace

int CameraPixels::TurnToOther() const {
  return frame == PixelFrame::kStored ? orientation : InverseOrientation(orientation);
}

bool CameraPixels::FramesAlike() const {
  constexpr int kPercent = 100;
  const int most = std::max(1, std::max(size.width, size.height) / kPercent);
  return orientation < kFirstTransposed || std::abs(size.width - size.height) <= most;
}

absl::StatusOr<FittedCamera> FitCamera(const Lens& lens, const PhotoFacts& photo, PixelFrame first,
                                       const std::string& name) {
  const auto fit = [&](PixelFrame frame) -> absl::StatusOr<FittedCamera> {
    FittedCamera camera;
    camera.pixels = {{name, photo.width, photo.height}, photo.orientation, frame};
    PhotoSize& size = camera.pixels.size;
    if (frame == PixelFrame::kUpright && photo.orientation >= kFirstTransposed) {
      std::swap(size.width, size.height);
    }
    ASSIGN_OR_RETURN(camera.lens, FitLens(lens, size.width, size.height, name));
    return camera;
  };
  if (photo.orientation == 1) return fit(PixelFrame::kStored);
  const absl::StatusOr<FittedCamera> camera = fit(first);
  if (camera.ok()) return camera;
  const absl::StatusOr<FittedCamera> other = fit(Other(first));
  return other.ok() ? other : camera;
}

// Reads the file for the frame that is expected, else for the other one. If neither fits, returns
// the error of the expected frame.
template <class T>
absl::StatusOr<CompanionFiles::Fitted<T>> CompanionFiles::ReadFitting(
    Companion kind, const DatasetFile& file, const CameraPixels& pixels, ReadingNotes* notes,
    absl::FunctionRef<absl::StatusOr<T>(const PhotoSize&)> read) const {
  const auto read_in = [&](PixelFrame frame) -> absl::StatusOr<Fitted<T>> {
    Fitted<T> fitted{{}, pixels.size, 1};
    if (frame != pixels.frame) {
      if (pixels.orientation >= kFirstTransposed) {
        std::swap(fitted.size.width, fitted.size.height);
      }
      fitted.turn = InverseOrientation(pixels.TurnToOther());
    }
    ASSIGN_OR_RETURN(fitted.content, read(fitted.size));
    return fitted;
  };
  if (pixels.orientation == 1) return read_in(pixels.frame);
  const auto decided = frames_.find(kind);
  PixelFrame frame = decided == frames_.end() ? PixelFrame::kStored : decided->second;
  absl::StatusOr<Fitted<T>> fitted = read_in(frame);
  if (!fitted.ok()) {
    frame = Other(frame);
    absl::StatusOr<Fitted<T>> other = read_in(frame);
    if (!other.ok()) return fitted.status();
    fitted = std::move(other);
  }
  if (notes != nullptr) notes->of_turned_photos[{kind, frame}].insert(file.name);
  return fitted;
}

absl::StatusOr<MaskSet> CompanionFiles::Masks(const std::string& stem, const CameraPixels& pixels,
                                              ReadingNotes* notes) const {
  const DatasetFile* file = FileOf(Companion::kMasks, stem);
  if (file == nullptr) return MaskSet();
  const auto folder = index_.mask_folders.find(stem);
  LabelNotes label;
  const auto read = [&](const PhotoSize& size) {
    return folder == index_.mask_folders.end() ? ReadMasks(file->path, file->name, size, &label)
                                               : ReadBinaryMasks(folder->second, size);
  };
  ASSIGN_OR_RETURN(const Fitted<MaskSet> masks,
                   ReadFitting<MaskSet>(Companion::kMasks, *file, pixels, notes, read));
  if (notes != nullptr && label.soft) notes->soft.insert(file->name);
  if (notes != nullptr && label.has_void) notes->with_void.insert(file->name);
  return Turned(masks.content, masks.turn);
}

absl::StatusOr<std::vector<uint8_t>> CompanionFiles::Ignored(const std::string& stem,
                                                             const CameraPixels& pixels,
                                                             ReadingNotes* notes) const {
  // A pixel is ignored if the mask for all views or one of the view's own says so.
  const DatasetFile* keep = Find(index_.keep, stem);
  std::vector<uint8_t> ignored;
  for (const DatasetFile* file : {index_.ignore_all, Find(index_.ignore, stem), keep}) {
    if (file == nullptr) continue;
    const auto read = [file](const PhotoSize& size) {
      return ReadIgnoreMask(file->path, file->name, size);
    };
    ASSIGN_OR_RETURN(
        const Fitted<std::vector<uint8_t>> fitted,
        ReadFitting<std::vector<uint8_t>>(Companion::kIgnore, *file, pixels, notes, read));
    const std::vector<uint8_t> mask =
        Turned(fitted.content, fitted.size.width, fitted.size.height, fitted.turn);
    ignored.resize(mask.size(), 0);
    for (size_t i = 0; i < mask.size(); ++i) {
      ignored[i] |= static_cast<uint8_t>(file == keep ? mask[i] == 0 : mask[i] != 0);
    }
  }
  return ignored;
}

absl::StatusOr<FloatImage> CompanionFiles::Depth(const std::string& stem,
                                                 const CameraPixels& pixels,
                                                 ReadingNotes* notes) const {
  const DatasetFile* file = FileOf(Companion::kDepth, stem);
  if (file == nullptr) return FloatImage();
  const auto kind =
      file->kind == FileKind::kDisparity ? DepthPrior::Kind::kDisparity : DepthPrior::Kind::kDepth;
  const auto read = [&](const PhotoSize& size) {
    return ReadDepthMap(file->path, file->name, kind, size);
  };
  ASSIGN_OR_RETURN(const Fitted<FloatImage> map,
                   ReadFitting<FloatImage>(Companion::kDepth, *file, pixels, notes, read));
  return Turned(map.content, map.turn);
}

const DatasetFile* CompanionFiles::FileOf(Companion kind, const std::string& stem) const {
  if (kind == Companion::kDepth) return Find(index_.depth, stem);
  if (kind == Companion::kMasks) {
    const auto folder = index_.mask_folders.find(stem);
    if (folder != index_.mask_folders.end()) return folder->second.front();
    return Find(index_.masks, stem);
  }
  for (const DatasetFile* file : {Find(index_.ignore, stem), Find(index_.keep, stem)}) {
    if (file != nullptr) return file;
  }
  return index_.ignore_all;
}

}  // namespace pepeseg
