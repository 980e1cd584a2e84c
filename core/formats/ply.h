#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

namespace pepeseg {

enum class PlyType { kInt8, kUint8, kInt16, kUint16, kInt32, kUint32, kFloat32, kFloat64 };

struct PlyProperty {
  std::string name;
  PlyType type = PlyType::kFloat32;
  int offset = 0;  // bytes from the start of a vertex
};

// The vertices of a binary little-endian PLY file, or of one in ASCII; what follows them is not
// looked at.
struct PlyVertices {
  std::filesystem::path path;
  std::string name;  // for errors
  int64_t count = 0;
  bool is_text = false;     // ASCII: a line for each vertex
  int stride = 0;           // bytes of a vertex, in binary
  int64_t data_offset = 0;  // of the first vertex in the file
  std::vector<PlyProperty> properties;

  // The index of a property, or -1.
  int Find(absl::string_view property) const;
};

// Reads the header. INVALID_ARGUMENT: not such a file, no vertices in front, more of them than
// `max_vertices` or than the file holds.
absl::StatusOr<PlyVertices> OpenPly(const std::filesystem::path& path, const std::string& name,
                                    int64_t max_vertices);

// One property of all vertices.
struct PlyColumn {
  int property = 0;
  std::span<float> values;  // [count], written
  double origin = 0;        // what they are relative to: subtracted in double
};
// INVALID_ARGUMENT names the vertex and the property of the first value that is not finite, or the
// first line that is no vertex.
absl::Status ReadColumns(const PlyVertices& vertices, std::span<const PlyColumn> columns);

}  // namespace pepeseg
