#include <algorithm>
#include <cmath>
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
#include "opencv2/imgcodecs.hpp"
#include "opencv2/imgproc.hpp"

namespace pepeseg {
namespace {

// A decoded image in OpenCV's order of channels: grey, BGR or BGRA.
struct Decoded {
  ImageHeader header;
  cv::Mat pixels;
};

// Decodes with `flags` of cv::ImreadModes. Reads the header first, so that nothing is allocated for
// an image over the limit, and compares the decoded size with it.
absl::StatusOr<Decoded> Decode(std::span<const uint8_t> bytes, absl::string_view name, int flags) {
  Decoded decoded;
  ASSIGN_OR_RETURN(decoded.header, ReadImageHeader(name, bytes));
  if (decoded.header.format == ImageFormat::kHeic) {
    return Refused(name, "HEIC is not read here: save it as a JPEG or PNG");
  }
  try {
    // cv::Mat has no view of const memory; imdecode() only reads it.
    const cv::Mat encoded(1, static_cast<int>(bytes.size()), CV_8UC1,
                          const_cast<uint8_t*>(bytes.data()));
    decoded.pixels = cv::imdecode(encoded, flags);
  } catch (const cv::Exception& error) {
    return Refused(name, absl::StrCat("does not decode: ", error.what()));
  }
  if (decoded.pixels.empty()) return Refused(name, "does not decode");
  if (decoded.pixels.cols != decoded.header.width || decoded.pixels.rows != decoded.header.height) {
    return Refused(
        name, absl::StrCat("its header says ", decoded.header.width, "x", decoded.header.height,
                           ", it decodes to ", decoded.pixels.cols, "x", decoded.pixels.rows));
  }
  return decoded;
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

// Returns a grey value, or a colour as 24 bits.
template <class T>
uint32_t LabelOf(const T* channels, int num_channels) {
  if (num_channels < 3) return channels[0];
  // Of 16-bit colours only the upper bytes count: PNG palettes, which label files use, have 8 bits.
  constexpr int kDrop = sizeof(T) * 8 - 8;
  return static_cast<uint32_t>(channels[0] >> kDrop) |
         static_cast<uint32_t>(channels[1] >> kDrop) << 8 |
         static_cast<uint32_t>(channels[2] >> kDrop) << 16;
}

template <class T>
void AppendLabels(const cv::Mat& pixels, std::vector<uint32_t>& labels) {
  for (int y = 0; y < pixels.rows; ++y) {
    const T* row = pixels.ptr<T>(y);
    for (int x = 0; x < pixels.cols; ++x) {
      labels.push_back(
          LabelOf(row + static_cast<ptrdiff_t>(x) * pixels.channels(), pixels.channels()));
    }
  }
}

// Returns 1 for each pixel of a BGRA image whose alpha is below one half, else 0.
std::vector<uint8_t> TransparentPixels(const cv::Mat& pixels) {
  constexpr int kHalf = 128, kAlpha = 3;
  std::vector<uint8_t> transparent;
  transparent.reserve(pixels.total());
  for (int y = 0; y < pixels.rows; ++y) {
    const auto* row = pixels.ptr<cv::Vec4b>(y);
    for (int x = 0; x < pixels.cols; ++x) transparent.push_back(row[x][kAlpha] < kHalf ? 1 : 0);
  }
  return transparent;
}

// Returns the alpha of each pixel as 1 where it is one half or more, else 0; empty: no alpha.
std::vector<uint8_t> OpaquePixels(const cv::Mat& pixels) {
  const int channels = pixels.channels();
  if (channels != 2 && channels != 4) return {};
  cv::Mat alpha;
  cv::extractChannel(pixels, alpha, channels - 1);
  const double half = alpha.depth() == CV_16U ? 0x8000 : 0x80;
  cv::Mat opaque = alpha >= half;  // 255 or 0
  opaque /= 255;
  return {opaque.begin<uint8_t>(), opaque.end<uint8_t>()};
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

Image Blank(int width, int height, int channels) {
  Image image{width, height, channels, {}};
  image.pixels.resize(static_cast<size_t>(width) * height * channels);
  return image;
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
  // IMREAD_UNCHANGED keeps alpha, and does not rotate by EXIF: the camera's parameters belong to
  // the stored pixels.
  ASSIGN_OR_RETURN(Decoded decoded, Decode(bytes, name, cv::IMREAD_UNCHANGED));
  if (decoded.pixels.type() == CV_16UC4) {  // only imdecode()'s 8 bits would lose the alpha
    constexpr double kToUpperByte = 1.0 / 257;
    decoded.pixels.convertTo(decoded.pixels, CV_8UC4, kToUpperByte);
  }
  const bool has_alpha = decoded.pixels.type() == CV_8UC4;
  // Other types are decoded again, because only imdecode() converts them all to 8-bit BGR.
  if (!has_alpha && decoded.pixels.type() != CV_8UC3) {  // grey, a palette, 16 bits
    ASSIGN_OR_RETURN(decoded,
                     Decode(bytes, name, cv::IMREAD_COLOR | cv::IMREAD_IGNORE_ORIENTATION));
    if (decoded.pixels.type() != CV_8UC3) return Refused(name, "does not decode to 8-bit colour");
  }
  Image image{decoded.header.width, decoded.header.height, 3, {}};
  image.pixels.resize(static_cast<size_t>(image.width) * image.height * 3);
  cv::Mat rgb(image.height, image.width, CV_8UC3, image.pixels.data());
  cv::cvtColor(decoded.pixels, rgb, has_alpha ? cv::COLOR_BGRA2RGB : cv::COLOR_BGR2RGB);
  if (has_alpha && transparent != nullptr) *transparent = TransparentPixels(decoded.pixels);
  return image;
}

absl::StatusOr<LabelImage> DecodeLabels(const std::filesystem::path& path, absl::string_view name) {
  ASSIGN_OR_RETURN(const std::string bytes, ReadFile(path, name, kMaxImageFileBytes));
  const auto* data = reinterpret_cast<const uint8_t*>(bytes.data());
  ASSIGN_OR_RETURN(Decoded decoded,
                   Decode(std::span(data, bytes.size()), name, cv::IMREAD_UNCHANGED));
  const std::vector<uint8_t> opaque = OpaquePixels(decoded.pixels);
  // imdecode() makes colours of grey values with alpha, of which only the upper bytes would count.
  if (IsGreyWithAlpha(bytes)) cv::extractChannel(decoded.pixels, decoded.pixels, 0);
  if (decoded.header.format != ImageFormat::kPng) {
    return Refused(name, "labels must be a PNG: other formats change them");
  }
  LabelImage image{decoded.header.width, decoded.header.height, {}};
  image.labels.reserve(decoded.pixels.total());
  if (decoded.pixels.depth() == CV_8U) {
    AppendLabels<uint8_t>(decoded.pixels, image.labels);
  } else if (decoded.pixels.depth() == CV_16U) {
    AppendLabels<uint16_t>(decoded.pixels, image.labels);
  } else {
    return Refused(name, "labels must have 8 or 16 bits");
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
  ASSIGN_OR_RETURN(const Decoded decoded, Decode(bytes, name, cv::IMREAD_UNCHANGED));
  if (decoded.header.format != ImageFormat::kPng) return Refused(name, "not a PNG");
  if (decoded.pixels.channels() != 1)
    return Refused(name,
                   "has colours, a palette or alpha instead of one grey value a pixel; save the "
                   "values themselves as a grey PNG");
  FloatImage image{decoded.header.width, decoded.header.height, {}};
  image.values.resize(decoded.pixels.total());
  // Keeps the values: 16 bits stay 0 to 65535.
  decoded.pixels.convertTo(cv::Mat(image.height, image.width, CV_32FC1, image.values.data()),
                           CV_32F);
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
