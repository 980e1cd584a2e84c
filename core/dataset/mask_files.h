#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "core/scene/mask_set.h"

namespace pepeseg {

inline constexpr int kMaxMasksOfView = 4096;

// The photograph that masks must fit.
struct PhotoSize {
  std::string name;
  int width = 0;
  int height = 0;
};

// INVALID_ARGUMENT with both sizes unless the mask, which `where` names, has its photograph's.
absl::Status CheckMaskSize(absl::string_view where, int64_t width, int64_t height,
                           const PhotoSize& photo);

// The masks of a photograph, by the suffix of `name`:
//   .json  what SAM's automatic mask generator writes: a list of {"segmentation": {"size":
//          [height, width], "counts": [run, ...] or "compressed"}}; its other fields are passed
//          over
//   .png   a label image: every value but 0 is a mask
// INVALID_ARGUMENT names the file and the mask, and both sizes where they differ.
absl::StatusOr<MaskSet> ReadMasks(const std::filesystem::path& path, const std::string& name,
                                  const PhotoSize& photo);

// An ignore mask of the photograph, 0 or 1 a pixel.
absl::StatusOr<std::vector<uint8_t>> ReadIgnoreMask(const std::filesystem::path& path,
                                                    const std::string& name,
                                                    const PhotoSize& photo);

}  // namespace pepeseg
