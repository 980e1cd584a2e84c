#include "core/dataset/depth_files.h"

#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>

#include "absl/strings/ascii.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "core/base/errors.h"
#include "core/base/file_io.h"
#include "core/base/file_name.h"
#include "core/base/status_macros.h"
#include "core/formats/image_header.h"
#include "core/formats/images.h"
#include "core/formats/npy.h"

namespace pepeseg {
namespace {

constexpr double kMaxShapeError = 0.01;  // relative difference of width / height

// Decodes the file by the suffix of its name.
absl::StatusOr<FloatImage> Decode(const std::filesystem::path& path, const std::string& name) {
  const std::string suffix = Suffix(name);
  if (suffix == ".png") return DecodeGrey(path, name);
  if (suffix != ".npy" && suffix != ".pfm") {
    return Refused(name, "depth maps come as .png, .npy or .pfm");
  }
  ASSIGN_OR_RETURN(const std::string bytes, ReadFile(path, name, kMaxImageFileBytes));
  return suffix == ".npy" ? ParseNpy(name, bytes) : ParsePfm(name, bytes);
}

// Compares the aspect ratios. Sensors and networks often give maps of another resolution than the
// photograph, but a map of another aspect ratio shows another part of the scene.
absl::Status CheckShape(const FloatImage& map, const std::string& name, const PhotoSize& photo) {
  // Decoders refuse empty maps, so no height is 0.
  const double shape = static_cast<double>(map.width) / map.height;
  const double photo_shape = static_cast<double>(photo.width) / photo.height;
  if (std::abs(shape - photo_shape) <= kMaxShapeError * photo_shape) return absl::OkStatus();
  return Refused(
      name, absl::StrCat("has ", map.width, "x", map.height, " pixels, its photograph ", photo.name,
                         " ", photo.width, "x", photo.height, ": not of one shape"));
}

// Removes the next word and the single white space after it from the front of `bytes`. Returns an
// empty word if the text has no white space or the word is too long.
absl::string_view TakeWord(absl::string_view& bytes) {
  constexpr size_t kLongest = 32;
  size_t length = 0;
  while (length < bytes.size() && length < kLongest && !absl::ascii_isspace(bytes[length])) {
    ++length;
  }
  if (length == bytes.size() || length == kLongest) return {};
  const absl::string_view word = bytes.substr(0, length);
  bytes.remove_prefix(length + 1);
  return word;
}

struct PfmHeader {
  uint64_t width = 0, height = 0;
  bool big_endian = false;
};

// Removes the header from the front of `bytes`.
absl::StatusOr<PfmHeader> TakePfmHeader(absl::string_view name, absl::string_view& bytes) {
  // "Pf", width, height and scale, each followed by one white space; then floats of 32 bits.
  const absl::string_view magic = TakeWord(bytes);
  if (magic == "PF") return Refused(name, "a PFM of three channels; depth has one (\"Pf\")");
  if (magic != "Pf") return Refused(name, "not a PFM file");
  PfmHeader header;
  double scale = 0;
  if (!absl::SimpleAtoi(TakeWord(bytes), &header.width) ||
      !absl::SimpleAtoi(TakeWord(bytes), &header.height) ||
      !absl::SimpleAtod(TakeWord(bytes), &scale) || !std::isfinite(scale) || scale == 0) {
    return Refused(name, "the PFM header is malformed or cut short");
  }
  // The sign of the scale is the byte order; its size is only a hint of units and not applied.
  header.big_endian = scale > 0;
  return header;
}

// Returns the value of a PFM at an index.
float ValueAt(absl::string_view bytes, size_t index, bool big_endian) {
  uint32_t bits = 0;
  std::memcpy(&bits, bytes.data() + index * sizeof(bits), sizeof(bits));
  if (big_endian) bits = __builtin_bswap32(bits);
  return std::bit_cast<float>(bits);
}

}  // namespace

absl::StatusOr<FloatImage> ParsePfm(absl::string_view name, absl::string_view bytes) {
  ASSIGN_OR_RETURN(const PfmHeader header, TakePfmHeader(name, bytes));
  const auto limit = static_cast<uint64_t>(kMaxImagePixels);
  if (header.width == 0 || header.height == 0) return Refused(name, "an empty image");
  if (header.width > limit || header.height > limit || header.width * header.height > limit) {
    return Refused(name, absl::StrCat(header.width, "x", header.height, " pixels, the limit is ",
                                      kMaxImagePixels));
  }
  if (bytes.size() / sizeof(float) < header.width * header.height) {
    return Refused(name, absl::StrCat("cut short: too few bytes for ", header.width, "x",
                                      header.height, " values"));
  }
  FloatImage image{static_cast<int>(header.width), static_cast<int>(header.height), {}};
  image.values.reserve(header.width * header.height);
  // The file has the bottom scanline first.
  for (size_t y = 0; y < header.height; ++y) {
    const size_t row = (header.height - 1 - y) * header.width;
    for (size_t x = 0; x < header.width; ++x) {
      image.values.push_back(ValueAt(bytes, row + x, header.big_endian));
    }
  }
  return image;
}

absl::StatusOr<FloatImage> ReadDepthMap(const std::filesystem::path& path, const std::string& name,
                                        DepthPrior::Kind kind, const PhotoSize& photo) {
  ASSIGN_OR_RETURN(FloatImage map, Decode(path, name));
  RETURN_IF_ERROR(CheckShape(map, name, photo));
  // Sensors write 0 where they measured nothing. In a disparity map 0 is a measurement: infinity.
  const bool zero_is_unknown = kind == DepthPrior::Kind::kDepth;
  for (size_t i = 0; i < map.values.size(); ++i) {
    if (!std::isfinite(map.values[i])) {
      return Refused(name, absl::StrCat("the value at x ", i % map.width, ", y ", i / map.width,
                                        " is not finite",
                                        zero_is_unknown ? "; 0 stands for unknown depth" : ""));
    }
    if (zero_is_unknown && map.values[i] == 0) {
      map.values[i] = std::numeric_limits<float>::quiet_NaN();
    }
  }
  return map;
}

}  // namespace pepeseg
