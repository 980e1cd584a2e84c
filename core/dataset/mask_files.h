#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "core/dataset/dataset_files.h"
#include "core/scene/mask_set.h"

namespace pepeseg {

inline constexpr int kMaxMasksOfView = 4096;

// Name and size in pixels of the photograph that a mask or depth map belongs to.
struct PhotoSize {
  std::string name;
  int width = 0;
  int height = 0;
};

// Returns INVALID_ARGUMENT with both sizes unless the mask, which `where` names, has the shape of
// its photograph within a pixel: masks are often made on photographs of another size.
absl::Status CheckMaskShape(absl::string_view where, int64_t width, int64_t height,
                            const PhotoSize& photo);

// What ReadMasks found in a label image.
struct LabelNotes {
  bool soft = false;      // it is one mask with soft borders: see SoftMaskThreshold
  bool has_void = false;  // void pixels along borders were left out: see HasVoidBorders
};

// Reads the masks of a photograph. Their format follows from the suffix of `name`:
//   .json  the output of SAM's automatic mask generator: a list of {"segmentation": {"size":
//          [height, width], "counts": [run, ...] or "compressed"}}; other fields are ignored
//   .png   a label image: each value except 0 is a mask; one mask with soft borders, see
//          SoftMaskThreshold, is cut at half of its value, and void pixels, see HasVoidBorders,
//          are in no mask
//   .npy   an array [masks, height, width] of booleans or bytes; 0 is outside; at most 512 MiB
// Masks of another size than the photograph are scaled. Sets `notes`, unless null.
// INVALID_ARGUMENT, naming the file and the mask: it is malformed, CheckMaskShape refuses a mask,
// or there are more than kMaxMasksOfView masks.
absl::StatusOr<MaskSet> ReadMasks(const std::filesystem::path& path, const std::string& name,
                                  const PhotoSize& photo, LabelNotes* notes = nullptr);

// Reads the masks of a photograph from PNGs with one binary mask each; pixels that are 0 in all
// channels are outside. Errors as ReadMasks.
absl::StatusOr<MaskSet> ReadBinaryMasks(std::span<const DatasetFile* const> files,
                                        const PhotoSize& photo);

// Adds a mask, which `where` names, to those of a photograph; empty masks and duplicates are
// dropped. INVALID_ARGUMENT: the bitsets of the masks, which grow with their overlaps, exceed 1
// GiB. Hostile masks could need far more memory than their files.
absl::Status AddMask(absl::string_view where, std::span<const uint32_t> pixels,
                     MaskSetBuilder& builder);

// Returns the pixels of a mask of width x height at the size of the photograph, by the nearest
// pixel.
std::vector<uint32_t> ScaledPixels(std::vector<uint32_t> pixels, int width, int height,
                                   const PhotoSize& photo);

// Reads an ignore mask of the photograph, a PNG. Returns 1 for pixels with a non-zero value, else
// 0. Errors as ReadMasks.
absl::StatusOr<std::vector<uint8_t>> ReadIgnoreMask(const std::filesystem::path& path,
                                                    const std::string& name,
                                                    const PhotoSize& photo);

}  // namespace pepeseg
