#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/statusor.h"
#include "core/dataset/dataset_index.h"
#include "core/dataset/mask_files.h"
#include "core/dataset/photo_file.h"
#include "core/dataset/pixel_frame.h"
#include "core/dataset/reading_notes.h"
#include "core/scene/capture.h"
#include "core/scene/lens.h"
#include "core/scene/mask_set.h"

namespace pepeseg {

// The pixel frame of each kind of companion where its size fits both frames of the photograph.
using CompanionFrames = std::map<Companion, PixelFrame>;

// The pixels that masks and depth of a photograph are returned in: those of its camera.
struct CameraPixels {
  PhotoSize size;       // of the frame of the camera
  int orientation = 1;  // EXIF orientation of the photograph, [1, 8]
  PixelFrame frame = PixelFrame::kStored;

  // Returns the EXIF orientation that turns these pixels to the other frame.
  int TurnToOther() const;
  // Returns true if a file that fits one frame also fits the other: the sides are not exchanged, or
  // differ by at most a pixel or 1 %.
  bool FramesAlike() const;
};

// A camera at the size of its photograph.
struct FittedCamera {
  Lens lens;
  CameraPixels pixels;
};

// Fits a lens to a photograph, which `name` names, in the frame whose shape it has; `first` where
// it has the shape of both. Errors as FitLens.
absl::StatusOr<FittedCamera> FitCamera(const Lens& lens, const PhotoFacts& photo, PixelFrame first,
                                       const std::string& name);

// Reads masks, ignore masks and depth maps of photographs. A file may have been made for the stored
// or for the upright pixels: it is read as the frame whose shape it has, and turned to the pixels
// of the camera. Where both shapes fit, `frames` decides; a kind that it lacks is of the stored
// pixels. Thread safe.
class CompanionFiles {
 public:
  // `index` must outlive it.
  explicit CompanionFiles(const DatasetIndex& index, CompanionFrames frames = {})
      : index_(index), frames_(std::move(frames)) {}

  // Return what the photograph `stem` (its name below images/ without suffix) has: its masks, the
  // pixels that its ignore masks exclude ([height, width], 1), and its depth map with NaN where
  // depth is unknown. Empty: it has none. They add to `notes` the masks with soft borders or void
  // pixels, and the files that were turned, unless it is null. Errors as ReadMasks, ReadIgnoreMask
  // and ReadDepthMap.
  absl::StatusOr<MaskSet> Masks(const std::string& stem, const CameraPixels& pixels,
                                ReadingNotes* notes = nullptr) const;
  absl::StatusOr<std::vector<uint8_t>> Ignored(const std::string& stem, const CameraPixels& pixels,
                                               ReadingNotes* notes = nullptr) const;
  absl::StatusOr<FloatImage> Depth(const std::string& stem, const CameraPixels& pixels,
                                   ReadingNotes* notes = nullptr) const;

  // Returns the file of a kind that names it in messages, or null.
  const DatasetFile* FileOf(Companion kind, const std::string& stem) const;

 private:
  // A file's content, and the frame of the photograph that it fits.
  template <class T>
  struct Fitted {
    T content;
    PhotoSize size;  // of that frame
    int turn = 1;    // EXIF orientation that turns it to the pixels of the camera
  };
  template <class T>
  absl::StatusOr<Fitted<T>> ReadFitting(
      Companion kind, const DatasetFile& file, const CameraPixels& pixels, ReadingNotes* notes,
      absl::FunctionRef<absl::StatusOr<T>(const PhotoSize&)> read) const;

  const DatasetIndex& index_;
  CompanionFrames frames_;
};

}  // namespace pepeseg
