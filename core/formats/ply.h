#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "core/scene/capture.h"

namespace pepeseg {

enum class PlyType { kInt8, kUint8, kInt16, kUint16, kInt32, kUint32, kFloat32, kFloat64 };

struct PlyProperty {
  std::string name;
  PlyType type = PlyType::kFloat32;
  int offset = 0;  // bytes from the start of a vertex
};

// The vertices of a PLY file, binary little-endian or ASCII. They must be its first element; the
// elements after them are ignored.
struct PlyVertices {
  std::filesystem::path path;
  std::string name;  // for errors
  int64_t count = 0;
  bool is_text = false;     // ASCII: one line for each vertex
  int stride = 0;           // bytes of a vertex in a binary file
  int64_t data_offset = 0;  // offset in the file of the first vertex
  std::vector<PlyProperty> properties;
  // The comment "pepeseg_origin X Y Z": what to add to the coordinates to get those of the world.
  // Zero: there is none.
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();

  // Returns the index of a property, or -1 if there is none of that name.
  int Find(absl::string_view property) const;
};

// Reads the header of a PLY file. INVALID_ARGUMENT, naming `name`: the file has another format, the
// vertices are not its first element or have a list property, or there are more of them than
// `max_vertices` or than the file can hold.
absl::StatusOr<PlyVertices> OpenPly(const std::filesystem::path& path, const std::string& name,
                                    int64_t max_vertices);

// Where to write one property of all vertices.
struct PlyColumn {
  int property = 0;         // index in PlyVertices::properties
  std::span<float> values;  // [count], output
  double origin = 0;        // subtracted from each value, in double
  float infinity = 0;       // what infinite values become, with their sign; 0: they are refused
};
// Returns what to subtract from coordinates of the file so that they are relative to `origin`.
Eigen::Vector3d OffsetTo(const Eigen::Vector3d& origin, const PlyVertices& vertices);

// Reads properties of all vertices. INVALID_ARGUMENT, naming the vertex: a value is not finite, or
// a line of an ASCII file does not have one number for each property. INTERNAL: the file cannot be
// read.
absl::Status ReadColumns(const PlyVertices& vertices, std::span<const PlyColumn> columns);

// Reads the vertices of a PLY file as points relative to `origin`, see OffsetTo: properties x, y, z
// and, if the file has them, red, green and blue in [0, 255] (else grey 128). Errors as OpenPly and
// ReadColumns, and INVALID_ARGUMENT if x, y or z is missing or there are more than kMaxPoints.
absl::StatusOr<std::vector<ScenePoint>> ReadPlyPoints(
    const std::filesystem::path& path, const std::string& name,
    const Eigen::Vector3d& origin = Eigen::Vector3d::Zero());

}  // namespace pepeseg
