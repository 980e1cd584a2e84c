#include "core/formats/gaussian_ply.h"

#include <algorithm>
#include <cassert>
#include <cstring>
#include <string_view>
#include <utility>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/base/file_io.h"
#include "core/base/status_macros.h"
#include "core/formats/ply.h"

namespace pepeseg {
namespace {

constexpr int64_t kMaxGaussians = 50'000'000;
constexpr int kNoPlane = -1;  // a property that is written as 0
// Opacities of 1 and 0 are infinite logits, which splat-transform and spz-js write. This one is 1
// to the last digit of a float.
constexpr float kMostLogit = 20;

// A property of the file and the plane of Gaussians that holds it.
struct Field {
  std::string name;
  int plane = kNoPlane;
};

// Returns the properties in the order in which 3DGS writes them. The planes hold SH coefficients
// interleaved by channel, the file holds them channel after channel.
std::vector<Field> FieldsOf(int sh_degree) {
  const int num_rest = NumShCoefficients(sh_degree) - 1;
  std::vector<Field> fields;
  const auto add = [&fields](const char* prefix, int count, int first_plane) {
    for (int i = 0; i < count; ++i) fields.push_back({absl::StrCat(prefix, i), first_plane + i});
  };
  for (int i = 0; i < 3; ++i) fields.push_back({std::string(1, "xyz"[i]), kMeanPlane + i});
  for (const char* normal : {"nx", "ny", "nz"}) fields.push_back({normal, kNoPlane});
  add("f_dc_", 3, kShPlane);
  for (int i = 0; i < 3 * num_rest; ++i) {
    const int channel = i / num_rest;
    const int coefficient = 1 + i % num_rest;
    fields.push_back({absl::StrCat("f_rest_", i), kShPlane + 3 * coefficient + channel});
  }
  fields.push_back({"opacity", kOpacityPlane});
  add("scale_", 3, kLogScalePlane);
  add("rot_", 4, kRotationPlane);
  return fields;
}

// Means far from zero need doubles once the origin is added to them.
bool IsDouble(const Field& field, const Eigen::Vector3d& origin) {
  return field.plane >= kMeanPlane && field.plane < kLogScalePlane && !origin.isZero(0);
}

// Returns the size of the property in the file.
size_t BytesOf(const Field& field, const Eigen::Vector3d& origin) {
  return IsDouble(field, origin) ? sizeof(double) : sizeof(float);
}

// Returns the header. `added` was added to the means; `left_out` is what is still to be added to
// them, named in a comment if it is not zero. `num_levels`: of segment ids.
std::string HeaderOf(const std::vector<Field>& fields, int64_t count, const Eigen::Vector3d& added,
                     const Eigen::Vector3d& left_out = Eigen::Vector3d::Zero(),
                     size_t num_levels = 0) {
  std::string header = "ply\nformat binary_little_endian 1.0\n";
  if (!left_out.isZero(0)) {
    absl::StrAppendFormat(&header, "comment pepeseg_origin %.17g %.17g %.17g\n", left_out.x(),
                          left_out.y(), left_out.z());
  }
  absl::StrAppend(&header, "element vertex ", count, "\n");
  for (const Field& field : fields) {
    const char* type = IsDouble(field, added) ? "double" : "float";
    absl::StrAppend(&header, "property ", type, " ", field.name, "\n");
  }
  for (size_t level = 0; level < num_levels; ++level) {
    absl::StrAppend(&header, "property int segment_", level, "\n");
  }
  return header + "end_header\n";
}

// Returns the SH degree that the number of f_rest properties implies.
absl::StatusOr<int> ShDegreeOf(const PlyVertices& vertices) {
  int num_rest = 0;
  // Without the base colour: 3 channels times (degree + 1)^2 - 1 coefficients.
  while (vertices.Find(absl::StrCat("f_rest_", num_rest)) >= 0) ++num_rest;
  for (int degree = 0; degree <= kMaxShDegree; ++degree) {
    if (num_rest == 3 * (NumShCoefficients(degree) - 1)) return degree;
  }
  return absl::InvalidArgumentError(absl::StrCat(
      vertices.name, ": has ", num_rest, " properties f_rest; 0, 9, 24 or 45 are possible"));
}

// Returns INVALID_ARGUMENT if a quaternion is zero, because it cannot be normalised.
absl::Status CheckRotations(const Gaussians& gaussians, const std::string& name) {
  for (int64_t i = 0; i < gaussians.count; ++i) {
    bool zero = true;
    for (int k = 0; k < 4; ++k) zero = zero && gaussians.Plane(kRotationPlane + k)[i] == 0;
    if (zero) {
      return absl::InvalidArgumentError(absl::StrCat(name, ": vertex ", i, ": rot is zero"));
    }
  }
  return absl::OkStatus();
}

// Returns the size of a vertex in the file.
size_t RowBytesOf(const std::vector<Field>& fields, const Eigen::Vector3d& origin) {
  size_t bytes = 0;
  for (const Field& field : fields) bytes += BytesOf(field, origin);
  return bytes;
}

// Encodes vertices first to first + count - 1 of the file, where vertex v is Gaussian index_of(v).
// Goes plane by plane, because planes are contiguous in memory.
template <typename IndexOf>
std::string EncodeVertices(const Gaussians& gaussians, const Eigen::Vector3d& origin, int64_t first,
                           int64_t count, IndexOf index_of, const SegmentIds& segment_ids = {}) {
  const std::vector<Field> fields = FieldsOf(gaussians.sh_degree);
  const size_t stride = RowBytesOf(fields, origin) + segment_ids.size() * sizeof(int32_t);
  std::string block(static_cast<size_t>(count) * stride, '\0');
  char* to = block.data();
  for (const Field& field : fields) {
    const size_t size = BytesOf(field, origin);
    if (field.plane != kNoPlane) {
      const std::span<const float> plane = gaussians.Plane(field.plane);
      const bool is_double = IsDouble(field, origin);
      for (int64_t row = 0; row < count; ++row) {
        const float value = plane[index_of(first + row)];
        // Planes 0 to 2 are the mean, which the file has in world coordinates.
        const double in_world = field.plane < 3 ? value + origin[field.plane] : 0;
        std::memcpy(to + row * stride, is_double ? static_cast<const void*>(&in_world) : &value,
                    size);
      }
    }
    to += size;
  }
  for (const std::vector<int32_t>& ids : segment_ids) {
    for (int64_t row = 0; row < count; ++row) {
      std::memcpy(to + row * stride, &ids[index_of(first + row)], sizeof(int32_t));
    }
    to += sizeof(int32_t);
  }
  return block;
}

// Passes the header and then the vertices to `append`, piece by piece.
absl::Status Encode(const Gaussians& gaussians, const Eigen::Vector3d& origin,
                    absl::FunctionRef<absl::Status(std::string_view)> append) {
  constexpr int64_t kBlockRows = 4096;
  RETURN_IF_ERROR(append(HeaderOf(FieldsOf(gaussians.sh_degree), gaussians.count, origin)));
  for (int64_t first = 0; first < gaussians.count; first += kBlockRows) {
    const int64_t count = std::min(kBlockRows, gaussians.count - first);
    RETURN_IF_ERROR(
        append(EncodeVertices(gaussians, origin, first, count, [](int64_t row) { return row; })));
  }
  return absl::OkStatus();
}

// Opens the file and refuses text: the layout of 3DGS is binary.
absl::StatusOr<PlyVertices> OpenGaussians(const std::filesystem::path& path,
                                          const std::string& name) {
  ASSIGN_OR_RETURN(PlyVertices vertices, OpenPly(path, name, kMaxGaussians));
  if (!vertices.is_text) return vertices;
  return absl::InvalidArgumentError(
      absl::StrCat(name, ": its format is ascii, that of Gaussians is binary_little_endian"));
}

}  // namespace

absl::Status WriteGaussianPly(const std::filesystem::path& path, const Gaussians& gaussians,
                              const Eigen::Vector3d& origin) {
  ASSIGN_OR_RETURN(AtomicFile file, AtomicFile::Create(path));
  RETURN_IF_ERROR(
      Encode(gaussians, origin, [&file](std::string_view bytes) { return file.Append(bytes); }));
  return file.Commit();
}

std::string EncodeGaussianPly(const Gaussians& gaussians, const Eigen::Vector3d& origin) {
  std::string ply;
  constexpr size_t kHeaderBytes = 2048;
  ply.reserve(kHeaderBytes + static_cast<size_t>(gaussians.count) * sizeof(float) *
                                 FieldsOf(gaussians.sh_degree).size());
  // Cannot fail: appending to a string never does.
  [[maybe_unused]] const absl::Status status =
      Encode(gaussians, origin, [&ply](std::string_view bytes) {
        ply += bytes;
        return absl::OkStatus();
      });
  assert(status.ok());
  return ply;
}

GaussianPlyBlocks::GaussianPlyBlocks(const Gaussians& gaussians, std::vector<uint32_t> indices,
                                     const Eigen::Vector3d& origin, PlyCoordinates coordinates,
                                     SegmentIds segment_ids)
    : GaussianRowBlocks(gaussians, std::move(indices)),
      added_(coordinates == PlyCoordinates::kWorld ? origin : Eigen::Vector3d(0, 0, 0)),
      segment_ids_(std::move(segment_ids)) {
  const std::vector<Field> fields = FieldsOf(gaussians.sh_degree);
  SetLayout(
      HeaderOf(fields, num_gaussians(), added_, origin - added_, segment_ids_.size()),
      static_cast<int64_t>(RowBytesOf(fields, added_) + segment_ids_.size() * sizeof(int32_t)));
}

std::string GaussianPlyBlocks::EncodeRows(int64_t first, int64_t count) const {
  return EncodeVertices(
      gaussians_, added_, first, count, [this](int64_t row) { return IndexOf(row); }, segment_ids_);
}

absl::StatusOr<Gaussians> ReadGaussianPly(const std::filesystem::path& path,
                                          const std::string& name, const Eigen::Vector3d& origin) {
  ASSIGN_OR_RETURN(const PlyVertices vertices, OpenGaussians(path, name));
  ASSIGN_OR_RETURN(const int sh_degree, ShDegreeOf(vertices));
  std::vector<int> properties;
  const std::vector<Field> fields = FieldsOf(sh_degree);
  for (const Field& field : fields) {
    properties.push_back(vertices.Find(field.name));
    // Normals (kNoPlane) are not needed.
    if (properties.back() < 0 && field.plane != kNoPlane) {
      return absl::InvalidArgumentError(absl::StrCat(name, ": has no property ", field.name));
    }
  }
  Gaussians gaussians = Gaussians::Zero(vertices.count, sh_degree);
  std::vector<PlyColumn> columns;
  const Eigen::Vector3d offset = OffsetTo(origin, vertices);
  for (size_t f = 0; f < fields.size(); ++f) {
    if (fields[f].plane == kNoPlane) continue;
    const int plane = fields[f].plane;
    columns.push_back({properties[f], gaussians.Plane(plane), plane < 3 ? offset[plane] : 0,
                       plane == kOpacityPlane ? kMostLogit : 0});
  }
  RETURN_IF_ERROR(ReadColumns(vertices, columns));
  RETURN_IF_ERROR(CheckRotations(gaussians, name));
  return gaussians;
}

absl::StatusOr<GaussianPlyShape> ReadGaussianPlyShape(const std::filesystem::path& path,
                                                      const std::string& name) {
  ASSIGN_OR_RETURN(const PlyVertices vertices, OpenGaussians(path, name));
  ASSIGN_OR_RETURN(const int sh_degree, ShDegreeOf(vertices));
  const int x = vertices.Find("x");
  const bool has_doubles =
      x >= 0 && vertices.properties[static_cast<size_t>(x)].type == PlyType::kFloat64;
  return GaussianPlyShape{vertices.count, sh_degree, has_doubles};
}

}  // namespace pepeseg
