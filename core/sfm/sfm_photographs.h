#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/dataset/import.h"
#include "core/formats/exif.h"
#include "core/formats/image_header.h"

namespace pepeseg {

// A photograph whose pose is wanted.
struct SfmPhotograph {
  std::string name;  // its owner's: metadata, as DatasetFile::name
  std::filesystem::path path;
  ImageHeader header;
  ExifCamera camera;
  std::string sha256;
  // Says where it must not be looked at, of this photograph or of all; or empty.
  std::vector<DatasetFile> ignore;
  bool is_video_frame = false;  // those about it in their order show what it shows
};

// The photographs among the files, in the order of their numbers ("7.jpg" before "10.jpg"), with
// what their first bytes tell. INVALID_ARGUMENT names the file: no photograph, cut short, too
// large.
absl::StatusOr<std::vector<SfmPhotograph>> ReadSfmPhotographs(std::span<const DatasetFile> files);

// FAILED_PRECONDITION, with what to do: fewer than 3 photographs, or fewer than 3 different ones.
absl::Status CheckEnough(std::span<const SfmPhotograph> photographs);

// Whether the names are numbered, as a camera's or a video's: each ends in a number.
bool AreNumbered(std::span<const SfmPhotograph> photographs);

// The name that photograph `index` has for COLMAP, relative to the folder of photographs: a folder
// for each camera (photographs of one size and one EXIF camera share it), a number, and the suffix
// that its bytes have: "c1/000001.jpg". Sorted as the photographs are, in each camera.
std::vector<std::string> SafeNames(std::span<const SfmPhotograph> photographs);

// Copies the photographs to their safe names below `images`: a worker's sandbox makes no links.
// Where they have ignore masks, writes what COLMAP wants of them below `masks`: a grey PNG, 0 where
// it must not look, of the name with ".png" behind it. True: there is one.
absl::StatusOr<bool> LayOut(std::span<const SfmPhotograph> photographs,
                            const std::filesystem::path& images,
                            const std::filesystem::path& masks);

}  // namespace pepeseg
