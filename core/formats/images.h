#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
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

// Encodes an image with 1 (grey), 3 (RGB) or 4 channels (RGBA) as a PNG file in memory.
// INVALID_ARGUMENT: the image is empty, has another number of channels, or its pixels do not fit
// its size.
absl::StatusOr<std::string> EncodePng(const Image& image);
// A grey image of 16 bits, for depth.
struct Grey16Image {
  int width = 0;
  int height = 0;
  std::vector<uint16_t> pixels;  // [height, width]
};
// Encodes it as a PNG of 16 bits. Errors as for 8 bits.
absl::StatusOr<std::string> EncodePng(const Grey16Image& image);
// Encodes an image with 1 or 3 channels as a JPEG file in memory. `quality` is in [1, 100]. Errors
// as EncodePng.
absl::StatusOr<std::string> EncodeJpeg(const Image& image, int quality = 90);

// Returns the value above which a pixel is inside, if the labels are those of one mask with soft
// borders: two values nearly everywhere, and others only between them, as drawing tools, blurs,
// resizing and JPEG leave them. Returns nothing for labels of several things, for masks with sharp
// borders, and for labels that are colours.
std::optional<uint32_t> SoftMaskThreshold(const LabelImage& image);

// Returns whether image.void_label marks void pixels, as along the borders of things in the label
// images of PASCAL VOC: hardly anywhere more than 7 pixels wide, mostly within 5 pixels of another
// label that is not 0, and, where labels are grey values, the largest one and not the last of a
// series.
bool HasVoidBorders(const LabelImage& image);

// Returns the labels at another size by the nearest pixel.
LabelImage ResizedLabels(const LabelImage& image, int width, int height);

}  // namespace pepeseg
