#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "core/scene/capture.h"

namespace pepeseg {

inline constexpr int64_t kMaxImageFileBytes = int64_t{512} << 20;

// One label for each pixel, row-major [height, width]. 0: none. The label of a colour is its
// 24 bits, blue in the lowest byte.
struct LabelImage {
  int width = 0;
  int height = 0;
  std::vector<uint32_t> labels;
  // Label that marks void pixels by the convention of PASCAL VOC, if the image uses it: 255, or the
  // colour of that entry of a palette.
  uint32_t void_label = 255;
};

// Decodes a JPEG, PNG or WebP photograph to 8-bit RGB. Ignores the EXIF orientation, because poses
// belong to the pixels as stored. If `transparent` is not null and the file has alpha, sets
// it to [height, width], 1 where alpha is below one half; otherwise leaves it as it is.
// INVALID_ARGUMENT, naming `name`: ReadImageHeader refuses the file, it is a HEIC photograph, or it
// does not decode.
absl::StatusOr<Image> DecodePhoto(const std::filesystem::path& path, absl::string_view name,
                                  std::vector<uint8_t>* transparent = nullptr);
absl::StatusOr<Image> DecodePhoto(std::span<const uint8_t> bytes, absl::string_view name,
                                  std::vector<uint8_t>* transparent = nullptr);

// Decodes a PNG of 1 to 16 bits a channel, grey or colour, to labels. Alpha is left out, unless the
// image is a cut-out: one colour everywhere, or more than 4096 of them, with opaque and transparent
// pixels. Labels of a cut-out are 1 where it is opaque, else 0. Errors as DecodePhoto, and
// INVALID_ARGUMENT for another format.
absl::StatusOr<LabelImage> DecodeLabels(const std::filesystem::path& path, absl::string_view name);

// Decodes a grey PNG of 1 to 16 bits, without scaling its values. Errors as DecodePhoto, and
// INVALID_ARGUMENT for another format or an image with colours.
absl::StatusOr<FloatImage> DecodeGrey(const std::filesystem::path& path, absl::string_view name);
absl::StatusOr<FloatImage> DecodeGrey(std::span<const uint8_t> bytes, absl::string_view name);

// Rotates and mirrors an image by an EXIF orientation in [1, 8], so that it is upright. Other
// values leave it unchanged.
Image Upright(Image image, int orientation);

// Shrinks an image by averaging, so that its longer side has `max_side` pixels. Returns it
// unchanged if it is not larger, or if `max_side` is 0.
Image ShrunkTo(Image image, int max_side);

}  // namespace pepeseg
