#include <algorithm>
#include <array>
#include <limits>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/byte_reader.h"
#include "core/base/errors.h"
#include "core/base/status_macros.h"
#include "core/formats/colmap_records.h"

// COLMAP's binary files: a 64-bit count, then the records without padding, little-endian. A count
// is checked against the size of the file before anything is allocated for it.
namespace pepeseg {
namespace {

// What a file counts, for TakeCount.
struct CountLimits {
  const char* what;
  uint64_t smallest_record;  // bytes of the shortest possible record
  int64_t most;              // limit of the count
};

// Reads the count of records at the front of the file.
absl::StatusOr<uint64_t> TakeCount(ByteReader& reader, const std::string& name,
                                   const CountLimits& limits) {
  const auto count = reader.Take<uint64_t>();
  if (!reader.ok()) return Refused(name, "the file is cut short: it has no count");
  if (count > static_cast<uint64_t>(limits.most)) {
    return Refused(
        name, absl::StrCat("declares ", count, " ", limits.what, ", the limit is ", limits.most));
  }
  if (count > reader.remaining() / limits.smallest_record) {
    return Refused(name, absl::StrCat("declares ", count, " ", limits.what, " of at least ",
                                      limits.smallest_record, " bytes, but only ",
                                      reader.remaining(), " bytes follow"));
  }
  return count;
}

// Returns INVALID_ARGUMENT if the reader went past the end.
absl::Status CheckRead(const ByteReader& reader, const std::string& where) {
  if (reader.ok()) return absl::OkStatus();
  return Refused(where, "the file is cut short");
}

// Returns INVALID_ARGUMENT if bytes follow the last record.
absl::Status CheckAllRead(const ByteReader& reader, const std::string& name) {
  if (reader.remaining() == 0) return absl::OkStatus();
  return Refused(name, absl::StrCat(reader.remaining(), " bytes follow the last record"));
}

// Clamps a width or height to int; Validate(Lens) refuses the large ones.
int ToSide(uint64_t side) {
  return static_cast<int>(std::min<uint64_t>(side, std::numeric_limits<int>::max()));
}

}  // namespace

absl::StatusOr<ColmapCameras> ParseCamerasBinary(absl::string_view bytes, const std::string& name) {
  ByteReader reader(bytes);
  // 48: id, model, width, height (4 + 4 + 8 + 8) and the three doubles of the smallest model.
  ASSIGN_OR_RETURN(const uint64_t count, TakeCount(reader, name, {"cameras", 48, kMaxViews}));
  ColmapCameras cameras;
  for (uint64_t i = 0; i < count; ++i) {
    const std::string where = absl::StrCat(name, ": camera ", i);
    const auto id = reader.Take<uint32_t>();
    const auto model = reader.Take<int32_t>();
    const auto width = reader.Take<uint64_t>();
    const auto height = reader.Take<uint64_t>();
    RETURN_IF_ERROR(CheckRead(reader, where));
    // The model decides how many parameters follow.
    if (model < 0 || model >= kNumLensModels) {
      return Refused(where, absl::StrCat("unknown camera model ", model));
    }
    const auto lens_model = static_cast<LensModel>(model);
    std::array<double, kMaxLensParameters> parameters{};
    reader.TakeAll(std::span<double>(parameters).first(NumParameters(lens_model)));
    RETURN_IF_ERROR(CheckRead(reader, where));
    const Lens lens = MakeLens(lens_model, ToSide(width), ToSide(height), parameters.data());
    RETURN_IF_ERROR(AddCamera(id, lens, where, cameras));
  }
  RETURN_IF_ERROR(CheckAllRead(reader, name));
  return cameras;
}

absl::StatusOr<std::vector<ColmapImage>> ParseImagesBinary(absl::string_view bytes,
                                                           const std::string& name) {
  constexpr uint64_t kPointBytes = 24;  // x, y, point id
  ByteReader reader(bytes);
  // 73: two ids, seven doubles, the NUL of an empty name, and the count of points.
  ASSIGN_OR_RETURN(const uint64_t count, TakeCount(reader, name, {"images", 73, kMaxViews}));
  std::vector<ColmapImage> images;
  for (uint64_t i = 0; i < count; ++i) {
    const std::string where = absl::StrCat(name, ": image ", i);
    ColmapImage image;
    ColmapPose pose;
    image.id = reader.Take<uint32_t>();
    reader.TakeAll(std::span<double>(pose.rotation));
    reader.TakeAll(std::span<double>(pose.translation));
    image.camera_id = reader.Take<uint32_t>();
    image.name = std::string(reader.TakeString());
    const auto num_points = reader.Take<uint64_t>();
    RETURN_IF_ERROR(CheckRead(reader, where));
    if (num_points > reader.remaining() / kPointBytes || !reader.Skip(num_points * kPointBytes)) {
      return Refused(where, absl::StrCat("declares ", num_points, " points of ", kPointBytes,
                                         " bytes, but only ", reader.remaining(), " bytes follow"));
    }
    RETURN_IF_ERROR(AddImage(std::move(image), pose, where, images));
  }
  RETURN_IF_ERROR(CheckAllRead(reader, name));
  return images;
}

absl::StatusOr<std::vector<ScenePoint>> ParsePointsBinary(absl::string_view bytes,
                                                          const std::string& name,
                                                          const Eigen::Vector3d& origin) {
  constexpr uint64_t kTrackBytes = 8;  // image id, index of its 2D point
  constexpr uint64_t kMaxTrack =
      uint64_t{1} << 40;  // more than any file holds; the product in bytes does not overflow
  ByteReader reader(bytes);
  // 51: id, three doubles, three bytes of colour, the error, and the length of the track.
  ASSIGN_OR_RETURN(const uint64_t count, TakeCount(reader, name, {"points", 51, kMaxPoints}));
  std::vector<ScenePoint> points;
  points.reserve(count);
  for (uint64_t i = 0; i < count; ++i) {
    reader.Skip(sizeof(uint64_t));  // id
    Eigen::Vector3d xyz;
    reader.TakeAll(std::span<double>(xyz.data(), 3));
    const int rgb[3] = {reader.Take<uint8_t>(), reader.Take<uint8_t>(), reader.Take<uint8_t>()};
    reader.Skip(sizeof(double));  // reprojection error
    const auto track_length = reader.Take<uint64_t>();
    if (!reader.Skip(std::min(track_length, kMaxTrack) * kTrackBytes)) {
      return Refused(absl::StrCat(name, ": point ", i), "the file is cut short");
    }
    // The name of the point is only made for an error: there may be 50 million points.
    const absl::Status added = AddPoint(xyz, origin, rgb, points);
    if (!added.ok()) return Refused(absl::StrCat(name, ": point ", i), added.message());
  }
  RETURN_IF_ERROR(CheckAllRead(reader, name));
  return points;
}

}  // namespace pepeseg
