#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/formats/images.h"
#include "opencv2/imgcodecs.hpp"
#include "opencv2/imgproc.hpp"

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

// Encodes grey, BGR or BGRA pixels.
absl::StatusOr<std::string> Encode(const cv::Mat& pixels, const char* suffix,
                                   const std::vector<int>& parameters) {
  std::vector<uint8_t> bytes;
  if (cv::imencode(suffix, pixels, bytes, parameters)) {
    return std::string(bytes.begin(), bytes.end());
  }
  return absl::InternalError("cannot encode an image");
}

absl::Status FromException(const cv::Exception& error) {
  return absl::InternalError(absl::StrCat("cannot encode an image: ", error.what()));
}

absl::StatusOr<std::string> Encode(const Image& image, const char* suffix,
                                   const std::vector<int>& parameters) {
  try {
    // cv::Mat has no view of const memory; the calls below only read it.
    cv::Mat pixels(image.height, image.width, CV_8UC(image.channels),
                   const_cast<uint8_t*>(image.pixels.data()));
    cv::Mat bgr;  // imencode() expects blue first
    if (image.channels == 1) bgr = pixels;
    if (image.channels == 3) cv::cvtColor(pixels, bgr, cv::COLOR_RGB2BGR);
    if (image.channels == 4) cv::cvtColor(pixels, bgr, cv::COLOR_RGBA2BGRA);
    return Encode(bgr, suffix, parameters);
  } catch (const cv::Exception& error) {
    return FromException(error);
  }
}

}  // namespace

absl::StatusOr<std::string> EncodePng(const Image& image) {
  RETURN_IF_ERROR(Validate(image, 4));
  return Encode(image, ".png", {});
}

absl::StatusOr<std::string> EncodePng(const Grey16Image& image) {
  const size_t size = static_cast<size_t>(image.width) * image.height;
  if (image.width <= 0 || image.height <= 0 || image.pixels.size() != size) {
    return absl::InvalidArgumentError(absl::StrCat("cannot encode a grey image of ", image.width,
                                                   "x", image.height, " with ", image.pixels.size(),
                                                   " pixels"));
  }
  try {
    // OpenCV writes the 16 bits in PNG's byte order, big-endian.
    const cv::Mat pixels(image.height, image.width, CV_16UC1,
                         const_cast<uint16_t*>(image.pixels.data()));
    return Encode(pixels, ".png", {});
  } catch (const cv::Exception& error) {
    return FromException(error);
  }
}

absl::StatusOr<std::string> EncodeJpeg(const Image& image, int quality) {
  RETURN_IF_ERROR(Validate(image, 3));
  return Encode(image, ".jpg", {cv::IMWRITE_JPEG_QUALITY, quality});
}

}  // namespace pepeseg
