#include "core/dataset/depth_files.h"

#include <cmath>
#include <limits>

#include "absl/strings/str_cat.h"
#include "core/base/file_bytes.h"
#include "core/base/file_name.h"
#include "core/base/private_error.h"
#include "core/base/status_macros.h"
#include "core/formats/decode_image.h"
#include "core/formats/npy.h"
#include "core/formats/pfm.h"

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

}  // namespace

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
