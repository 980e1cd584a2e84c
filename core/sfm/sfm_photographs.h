#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/dataset/import.h"
#include "core/dataset/pixel_frame.h"
#include "core/formats/exif.h"
#include "core/formats/image_header.h"

namespace pepeseg {

// A photograph whose pose is to be estimated.
struct SfmPhotograph {
  std::string name;  // the owner's name; a label, never opened as a path (DatasetFile::name)
  std::filesystem::path path;
  ImageHeader header;   // of the stored pixels, which COLMAP sees
  int orientation = 1;  // EXIF orientation, [1, 8]
  ExifCamera camera;
  std::string sha256;
  // Ignore masks that apply to it: that of all photographs and its own. May be empty.
  std::vector<DatasetFile> ignore;
  PixelFrame ignore_frame = PixelFrame::kStored;  // of ignore masks whose size fits both frames
  bool is_video_frame = false;                    // true: its neighbours in order overlap with it
};

// Reads headers, EXIF data and digests of the photographs among the files. Sorts them by their
// numbers ("7.jpg" before "10.jpg"). INVALID_ARGUMENT, naming the file: it is not a photograph, is
// cut short, or is too large; or as ChooseCompanionFrames for the ignore masks.
absl::StatusOr<std::vector<SfmPhotograph>> ReadSfmPhotographs(std::span<const DatasetFile> files);

// Returns FAILED_PRECONDITION, with what to do, if there are fewer than 3 photographs with
// different bytes.
absl::Status CheckEnough(std::span<const SfmPhotograph> photographs);

// Returns true if every name ends in a number, as cameras and video tools name files.
bool AreNumbered(std::span<const SfmPhotograph> photographs);

// Returns the pixels that the photograph's ignore masks exclude, [height, width] of the stored
// pixels, 1; none if it has no ignore masks. Errors as CompanionFiles::Ignored.
absl::StatusOr<std::vector<uint8_t>> IgnoredPixels(const SfmPhotograph& photograph);

// Returns the index of each photograph's camera, from 0 in the order of their first photographs.
// Photographs of equal size and equal EXIF camera share one: they were taken with one lens at one
// setting.
std::vector<size_t> CameraIndices(std::span<const SfmPhotograph> photographs);

// Returns the names for COLMAP, relative to its folder of photographs: "c1/000001.jpg". The folder
// is the camera, by its index + 1. The number is the
// photograph's index + 1, so that each folder sorts like the photographs. The suffix is that of the
// format. The owner's names never reach the file system.
std::vector<std::string> SafeNames(std::span<const SfmPhotograph> photographs);

// Copies the photographs to their safe names below `images` (the worker's sandbox forbids links).
// For a photograph with ignore masks, writes the mask that COLMAP expects below `masks`: a grey PNG
// with the photograph's name plus ".png", 0 where COLMAP must not look. Returns true if it wrote a
// mask.
absl::StatusOr<bool> LayOut(std::span<const SfmPhotograph> photographs,
                            const std::filesystem::path& images,
                            const std::filesystem::path& masks);

}  // namespace pepeseg
