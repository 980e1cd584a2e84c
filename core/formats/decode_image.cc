#include <webp/decode.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <optional>
#include <string>
#include <unordered_set>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/errors.h"
#include "core/base/file_io.h"
#include "core/base/status_macros.h"
#include "core/formats/image_header.h"
#include "core/formats/images.h"
#include "core/formats/jpeg_file.h"
#include "core/formats/png_file.h"
#include "opencv2/imgproc.hpp"

namespace pepeseg {
namespace {

// Returns the i-th sample of a PNG's pixels.
template <class T>
T SampleAt(const std::vector<uint8_t>& bytes, size_t i) {
  T sample;
  std::memcpy(&sample, bytes.data() + i * sizeof(T), sizeof(T));
  return sample;
}

// Reads the header, so that nothing is allocated for an image over the limit.
absl::StatusOr<ImageHeader> ReadHeaderOf(std::span<const uint8_t> bytes, absl::string_view name) {
  ASSIGN_OR_RETURN(const ImageHeader header, ReadImageHeader(name, bytes));
  if (header.format == ImageFormat::kHeic) {
    return Refused(name, "HEIC is not read here: save it as a JPEG or PNG");
  }
  return header;
}

// Returns the stored pixels of a PNG. `otherwise`: why other formats are refused.
absl::StatusOr<PngPixels> DecodeStored(std::span<const uint8_t> bytes, absl::string_view name,
                                       absl::string_view otherwise, ImageHeader& header) {
  ASSIGN_OR_RETURN(header, ReadHeaderOf(bytes, name));
  if (header.format != ImageFormat::kPng) return Refused(name, otherwise);
  return DecodePng(bytes, header, name, PngForm::kStored);
}

Image Blank(int width, int height, int channels) {
  Image image{width, height, channels, {}};
  image.pixels.resize(static_cast<size_t>(width) * height * channels);
  return image;
}

// Writes the RGB values of a scanline of libjpeg to `rgb`. Returns the end of what it has written.
uint8_t* PutRgb(std::span<const uint8_t> scanline, int channels, uint8_t* rgb) {
  if (channels == 3) return std::copy(scanline.begin(), scanline.end(), rgb);
  for (size_t i = 0; channels == 1 && i < scanline.size(); ++i) {
    rgb = std::fill_n(rgb, 3, scanline[i]);
  }
  for (size_t i = 0; channels == 4 && i < scanline.size(); i += 4) {
    const int black = scanline[i + 3];
    for (size_t c = 0; c < 3; ++c) {
      *rgb++ = static_cast<uint8_t>(black - ((255 - scanline[i + c]) * black >> 8));
    }
  }
  return rgb;
}

absl::StatusOr<Image> DecodeJpegPhoto(std::span<const uint8_t> bytes, const ImageHeader& header,
                                      absl::string_view name) {
  Image image;
  uint8_t* end = nullptr;
  const auto take = [&](std::span<const uint8_t> scanline, int channels) {
    if (end == nullptr) {
      image = Blank(header.width, header.height, 3);
      end = image.pixels.data();
    }
    end = PutRgb(scanline, channels, end);
  };
  RETURN_IF_ERROR(DecodeJpeg(bytes, header, name, JpegDecoding::kAccurate, take));
  return image;
}

// Returns 3 or 4 channels.
absl::StatusOr<Image> DecodeWebp(std::span<const uint8_t> bytes, const ImageHeader& header,
                                 absl::string_view name) {
  // An extended file says here which features it has; the bitstreams in it are read when decoding.
  constexpr size_t kFront = 32;
  WebPBitstreamFeatures features{};
  if (WebPGetFeatures(bytes.data(), std::min(bytes.size(), kFront), &features) != VP8_STATUS_OK) {
    return Refused(name, "does not decode");
  }
  if (features.has_animation != 0) return Refused(name, "does not decode: it is an animation");
  if (features.width != header.width || features.height != header.height) {
    return Refused(name, absl::StrCat("its header says ", header.width, "x", header.height,
                                      ", it decodes to ", features.width, "x", features.height));
  }
  Image image = Blank(header.width, header.height, features.has_alpha != 0 ? 4 : 3);
  const auto decode = image.channels == 4 ? WebPDecodeRGBAInto : WebPDecodeRGBInto;
  if (decode(bytes.data(), bytes.size(), image.pixels.data(), image.pixels.size(),
             image.width * image.channels) == nullptr) {
    return Refused(name, "does not decode");
  }
  return image;
}

// Returns 3 or 4 channels. Alpha has 8 or 16 bits with its colours; the latter are rounded.
absl::StatusOr<Image> DecodePngPhoto(std::span<const uint8_t> bytes, const ImageHeader& header,
                                     absl::string_view name) {
  ASSIGN_OR_RETURN(PngPixels png, DecodePng(bytes, header, name, PngForm::kPhotograph));
  Image image{header.width, header.height, png.channels, {}};
  if (png.bit_depth == 8) {
    image.pixels = std::move(png.bytes);
    return image;
  }
  image.pixels.resize(png.bytes.size() / 2);
  for (size_t i = 0; i < image.pixels.size(); ++i) {
    image.pixels[i] = static_cast<uint8_t>((SampleAt<uint16_t>(png.bytes, i) + 128) / 257);
  }
  return image;
}

// Returns 3 or 4 channels.
absl::StatusOr<Image> DecodeColours(std::span<const uint8_t> bytes, absl::string_view name) {
  ASSIGN_OR_RETURN(const ImageHeader header, ReadHeaderOf(bytes, name));
  if (header.format == ImageFormat::kJpeg) return DecodeJpegPhoto(bytes, header, name);
  if (header.format == ImageFormat::kPng) return DecodePngPhoto(bytes, header, name);
  return DecodeWebp(bytes, header, name);
}

// Returns true for a PNG of this kind, by its header.
bool IsGreyWithAlpha(absl::string_view png) {
  constexpr size_t kColourType = 25;  // position in the file, PNG 11.2.2
  return png.size() > kColourType && png[kColourType] == 4;
}

// Returns the 24 bits of entry 255 of a PNG's palette, blue in the lowest byte; nothing if the PNG
// has none, entry 0 is not black, or another entry has the colour.
std::optional<uint32_t> LastOfPalette(absl::string_view png) {
  constexpr size_t kColourType = 25, kFirstChunk = 8, kHeader = 8, kChecksum = 4;
  constexpr size_t kEntries = 256;
  if (png.size() <= kColourType || png[kColourType] != 3) return std::nullopt;
  for (size_t at = kFirstChunk; at + kHeader <= png.size();) {
    size_t length = 0;
    for (size_t i = 0; i < 4; ++i) length = length << 8 | static_cast<uint8_t>(png[at + i]);
    if (png.size() - at - kHeader < length) return std::nullopt;
    if (png.substr(at + 4, 4) == "PLTE") {
      if (length != 3 * kEntries) return std::nullopt;
      const auto colour = [&](size_t entry) {
        uint32_t value = 0;
        for (size_t c = 0; c < 3; ++c) {
          value = value << 8 | static_cast<uint8_t>(png[at + kHeader + 3 * entry + c]);
        }
        return value;
      };
      const uint32_t last = colour(kEntries - 1);
      for (size_t entry = 0; entry + 1 < kEntries; ++entry) {
        if (colour(entry) == last) return std::nullopt;
      }
      return colour(0) == 0 ? std::optional(last) : std::nullopt;
    }
    at += kHeader + length + kChecksum;
  }
  return std::nullopt;
}

// Returns a grey value, or a colour as 24 bits. `pixel`: grey, RGB or RGBA.
template <class T>
uint32_t LabelOf(const T* pixel, size_t num_channels) {
  if (num_channels < 3) return pixel[0];
  // Of 16-bit colours only the upper bytes count: PNG palettes, which label files use, have 8 bits.
  constexpr int kDrop = sizeof(T) * 8 - 8;
  return static_cast<uint32_t>(pixel[2] >> kDrop) | static_cast<uint32_t>(pixel[1] >> kDrop) << 8 |
         static_cast<uint32_t>(pixel[0] >> kDrop) << 16;
}

// Sets the label of each pixel, and whether its alpha is one half or more (1) or not (0), if it has
// alpha. `is_grey`: colours are grey values with alpha, of which all bits count.
template <class T>
void ReadLabels(const PngPixels& png, bool is_grey, std::vector<uint32_t>& labels,
                std::vector<uint8_t>& opaque) {
  constexpr uint32_t kHalf = uint32_t{1} << (sizeof(T) * 8 - 1);
  const auto channels = static_cast<size_t>(png.channels);
  const size_t num_pixels = png.bytes.size() / sizeof(T) / channels;
  labels.reserve(num_pixels);
  if (channels == 4) opaque.reserve(num_pixels);
  for (size_t i = 0; i < num_pixels; ++i) {
    std::array<T, 4> pixel{};
    std::memcpy(pixel.data(), png.bytes.data() + i * channels * sizeof(T), channels * sizeof(T));
    labels.push_back(LabelOf(pixel.data(), is_grey ? 1 : channels));
    if (channels == 4) opaque.push_back(pixel[3] >= kHalf ? 1 : 0);
  }
}

// Removes the alpha of an RGBA image. Sets `transparent`, if it is not null, to 1 for each pixel
// whose alpha is below one half, else 0.
void TakeAlpha(Image& image, std::vector<uint8_t>* transparent) {
  constexpr size_t kRgba = 4;
  constexpr int kHalf = 128;
  const size_t num_pixels = image.pixels.size() / kRgba;
  if (transparent != nullptr) transparent->resize(num_pixels);
  for (size_t i = 0; i < num_pixels; ++i) {
    if (transparent != nullptr) (*transparent)[i] = image.pixels[kRgba * i + 3] < kHalf ? 1 : 0;
    std::copy_n(&image.pixels[kRgba * i], 3, &image.pixels[3 * i]);
  }
  image.channels = 3;
  image.pixels.resize(3 * num_pixels);
}

// Replaces the labels of a cut-out by its alpha: see DecodeLabels.
void TakeCutOut(const std::vector<uint8_t>& opaque, std::vector<uint32_t>& labels) {
  constexpr size_t kMostColours = 4096;
  if (std::ranges::find(opaque, 0) == opaque.end()) return;
  if (std::ranges::find(opaque, 1) == opaque.end()) return;
  std::unordered_set<uint32_t> colours;
  for (size_t i = 0; i < labels.size() && colours.size() <= kMostColours; ++i) {
    colours.insert(labels[i]);
  }
  if (colours.size() > 1 && colours.size() <= kMostColours) return;
  labels.assign(opaque.begin(), opaque.end());
}

// Returns a view of the image's pixels.
cv::Mat PixelsOf(Image& image) {
  return {image.height, image.width, CV_8UC(image.channels), image.pixels.data()};
}

// Exchanges rows and columns.
Image Transposed(Image image) {
  Image result = Blank(image.height, image.width, image.channels);
  cv::Mat pixels = PixelsOf(result);
  cv::transpose(PixelsOf(image), pixels);
  return result;
}

}  // namespace

absl::StatusOr<Image> DecodePhoto(const std::filesystem::path& path, absl::string_view name,
                                  std::vector<uint8_t>* transparent) {
  ASSIGN_OR_RETURN(const std::string bytes, ReadFile(path, name, kMaxImageFileBytes));
  const auto* data = reinterpret_cast<const uint8_t*>(bytes.data());
  return DecodePhoto(std::span(data, bytes.size()), name, transparent);
}

absl::StatusOr<Image> DecodePhoto(std::span<const uint8_t> bytes, absl::string_view name,
                                  std::vector<uint8_t>* transparent) {
  // No format is rotated by EXIF: the camera's parameters belong to the stored pixels.
  ASSIGN_OR_RETURN(Image image, DecodeColours(bytes, name));
  if (image.channels == 4) TakeAlpha(image, transparent);
  return image;
}

absl::StatusOr<LabelImage> DecodeLabels(const std::filesystem::path& path, absl::string_view name) {
  ASSIGN_OR_RETURN(const std::string bytes, ReadFile(path, name, kMaxImageFileBytes));
  const auto* data = reinterpret_cast<const uint8_t*>(bytes.data());
  ImageHeader header;
  ASSIGN_OR_RETURN(const PngPixels png,
                   DecodeStored(std::span(data, bytes.size()), name,
                                "labels must be a PNG: other formats change them", header));
  LabelImage image{header.width, header.height, {}};
  std::vector<uint8_t> opaque;
  if (png.bit_depth == 8) {
    ReadLabels<uint8_t>(png, IsGreyWithAlpha(bytes), image.labels, opaque);
  } else {
    ReadLabels<uint16_t>(png, IsGreyWithAlpha(bytes), image.labels, opaque);
  }
  if (!opaque.empty()) TakeCutOut(opaque, image.labels);
  image.void_label = LastOfPalette(bytes).value_or(image.void_label);
  return image;
}

absl::StatusOr<FloatImage> DecodeGrey(const std::filesystem::path& path, absl::string_view name) {
  ASSIGN_OR_RETURN(const std::string bytes, ReadFile(path, name, kMaxImageFileBytes));
  const auto* data = reinterpret_cast<const uint8_t*>(bytes.data());
  return DecodeGrey(std::span(data, bytes.size()), name);
}

absl::StatusOr<FloatImage> DecodeGrey(std::span<const uint8_t> bytes, absl::string_view name) {
  ImageHeader header;
  ASSIGN_OR_RETURN(const PngPixels png, DecodeStored(bytes, name, "not a PNG", header));
  if (png.channels != 1)
    return Refused(name,
                   "has colours, a palette or alpha instead of one grey value a pixel; save the "
                   "values themselves as a grey PNG");
  FloatImage image{header.width, header.height, {}};
  image.values.resize(static_cast<size_t>(header.width) * header.height);
  // Keeps the values: 16 bits stay 0 to 65535.
  for (size_t i = 0; i < image.values.size(); ++i) {
    image.values[i] = png.bit_depth == 8 ? png.bytes[i] : SampleAt<uint16_t>(png.bytes, i);
  }
  return image;
}

Image Upright(Image image, int orientation) {
  // EXIF 2.3, tag 0x0112: 5 to 8 are transposed first; then one axis, both or none is mirrored.
  const bool transposed = orientation >= 5 && orientation <= 8;
  if (transposed) image = Transposed(std::move(image));
  const bool mirrors_x =
      orientation == 2 || orientation == 3 || orientation == 6 || orientation == 7;
  const bool mirrors_y =
      orientation == 3 || orientation == 4 || orientation == 7 || orientation == 8;
  if (!mirrors_x && !mirrors_y) return image;
  cv::Mat pixels = PixelsOf(image);
  constexpr int kAroundX = 0, kAroundY = 1, kBoth = -1;  // codes of cv::flip
  cv::flip(pixels, pixels, mirrors_x && mirrors_y ? kBoth : mirrors_x ? kAroundY : kAroundX);
  return image;
}

Image ShrunkTo(Image image, int max_side) {
  // 0 or less: no limit.
  const int side = std::max(image.width, image.height);
  if (max_side <= 0 || side <= max_side) return image;
  const double scale = static_cast<double>(max_side) / side;
  // A narrow image keeps at least one pixel.
  const auto shrunk = [scale](int size) {
    return std::max(1, static_cast<int>(std::lround(size * scale)));
  };
  Image result = Blank(shrunk(image.width), shrunk(image.height), image.channels);
  cv::Mat pixels = PixelsOf(result);
  cv::resize(PixelsOf(image), pixels, pixels.size(), 0, 0, cv::INTER_AREA);
  return result;
}

}  // namespace pepeseg
