#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/formats/images.h"
#include "core/formats/jpeg_file.h"
#include "core/formats/png_file.h"

namespace pepeseg {
namespace {

// Checks size and channels: 1, or 3 to `most_channels`.
absl::Status Validate(const Image& image, int most_channels) {
  const size_t size = static_cast<size_t>(image.width) * image.height * image.channels;
  // JPEG has no alpha: EncodeJpeg allows three channels only.
  const bool has_colors = image.channels >= 3 && image.channels <= most_channels;
  if (image.width > 0 && image.height > 0 && (image.channels == 1 || has_colors) &&
      image.pixels.size() == size) {
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(absl::StrCat("cannot encode an image of ", image.width, "x",
                                                 image.height, "x", image.channels, " with ",
                                                 image.pixels.size(), " bytes"));
}

}  // namespace

absl::StatusOr<std::string> EncodePng(const Image& image) {
  RETURN_IF_ERROR(Validate(image, 4));
  return PngBytes(image.width, image.height, image.channels, 8, image.pixels.data());
}

absl::StatusOr<std::string> EncodePng(const Grey16Image& image) {
  const size_t size = static_cast<size_t>(image.width) * image.height;
  if (image.width <= 0 || image.height <= 0 || image.pixels.size() != size) {
    return absl::InvalidArgumentError(absl::StrCat("cannot encode a grey image of ", image.width,
                                                   "x", image.height, " with ", image.pixels.size(),
                                                   " pixels"));
  }
  return PngBytes(image.width, image.height, 1, 16,
                  reinterpret_cast<const uint8_t*>(image.pixels.data()));
}

absl::StatusOr<std::string> EncodeJpeg(const Image& image, int quality) {
  RETURN_IF_ERROR(Validate(image, 3));
  return JpegBytes(image, quality);
}

}  // namespace pepeseg
