#include "core/formats/ply.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <fstream>
#include <optional>

#include "absl/strings/ascii.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "core/base/errors.h"
#include "core/base/file_io.h"
#include "core/base/status_macros.h"
#include "core/formats/colmap.h"

namespace pepeseg {
namespace {

constexpr int64_t kMaxHeaderBytes = 64 << 10;
constexpr size_t kMaxProperties = 512;
constexpr size_t kMaxLineBytes = 16 << 10;

// Each type has an old and a new name.
struct TypeName {
  const char* name;
  PlyType type;
};
constexpr std::array<TypeName, 16> kTypeNames = {{{"char", PlyType::kInt8},
                                                  {"int8", PlyType::kInt8},
                                                  {"uchar", PlyType::kUint8},
                                                  {"uint8", PlyType::kUint8},
                                                  {"short", PlyType::kInt16},
                                                  {"int16", PlyType::kInt16},
                                                  {"ushort", PlyType::kUint16},
                                                  {"uint16", PlyType::kUint16},
                                                  {"int", PlyType::kInt32},
                                                  {"int32", PlyType::kInt32},
                                                  {"uint", PlyType::kUint32},
                                                  {"uint32", PlyType::kUint32},
                                                  {"float", PlyType::kFloat32},
                                                  {"float32", PlyType::kFloat32},
                                                  {"double", PlyType::kFloat64},
                                                  {"float64", PlyType::kFloat64}}};

// Returns the type, or nothing if the name is unknown ("list", for example).
std::optional<PlyType> TypeByName(absl::string_view name) {
  for (const TypeName& entry : kTypeNames) {
    if (name == entry.name) return entry.type;
  }
  return std::nullopt;
}

int SizeOf(PlyType type) {
  // In the order of PlyType.
  constexpr std::array<int, 8> kSizes = {1, 1, 2, 2, 4, 4, 4, 8};
  return kSizes[static_cast<size_t>(type)];
}

template <class T>
double Load(const char* from) {
  T value;
  std::memcpy(&value, from, sizeof(T));
  return static_cast<double>(value);
}

// Returns the number of that type at `from`, which need not be aligned.
double LoadAs(PlyType type, const char* from) {
  switch (type) {
    case PlyType::kInt8:
      return Load<int8_t>(from);
    case PlyType::kUint8:
      return Load<uint8_t>(from);
    case PlyType::kInt16:
      return Load<int16_t>(from);
    case PlyType::kUint16:
      return Load<uint16_t>(from);
    case PlyType::kInt32:
      return Load<int32_t>(from);
    case PlyType::kUint32:
      return Load<uint32_t>(from);
    case PlyType::kFloat32:
      return Load<float>(from);
    case PlyType::kFloat64:
      return Load<double>(from);
  }
  return 0;
}

// Returns the header at the front of `bytes`, up to and including the end of the line "end_header",
// or an empty text if it has no end. Lines end with "\n" or, as on Windows, with "\r\n".
absl::string_view HeaderOf(absl::string_view bytes) {
  for (const absl::string_view end : {"\nend_header\n", "\nend_header\r\n"}) {
    const size_t at = bytes.find(end);
    if (at != absl::string_view::npos) return bytes.substr(0, at + end.size());
  }
  return {};
}

using Words = std::vector<absl::string_view>;

// Parses the header line by line. Its methods return what is wrong, or an empty string.
class HeaderParser {
 public:
  explicit HeaderParser(PlyVertices& vertices) : vertices_(vertices) {}

  std::string TakeLine(const Words& words) {
    if (words.empty() || words[0] == "obj_info") return "";
    if (words[0] == "comment") return TakeComment(words);
    if (words[0] == "format") return TakeFormat(words);
    if (words[0] == "element") return TakeElement(words);
    // Elements after the vertices, such as faces, are not read.
    if (words[0] == "property") return in_vertices_ ? TakeProperty(words) : "";
    return absl::StrCat("the header has the line \"", words[0].substr(0, 40), " ...\"");
  }

  // Checks what can only be known after the last line.
  std::string Finish() const {
    if (!has_format_) return "the header names no format";
    if (num_elements_ == 0) return "has no vertices";
    if (vertices_.stride == 0) return "its vertices have no properties";
    return "";
  }

 private:
  // Other comments than "pepeseg_origin X Y Z" are for people.
  std::string TakeComment(const Words& words) {
    if (words.size() < 2 || words[1] != "pepeseg_origin") return "";
    Eigen::Vector3d origin;
    bool ok = words.size() == 5;
    for (int k = 0; ok && k < 3; ++k) {
      ok = absl::SimpleAtod(words[static_cast<size_t>(k) + 2], &origin[k]) &&
           std::isfinite(origin[k]);
    }
    if (!ok) return "its comment pepeseg_origin has no three finite numbers";
    vertices_.origin = origin;
    return "";
  }

  std::string TakeFormat(const Words& words) {
    has_format_ = true;
    vertices_.is_text = words.size() == 3 && words[1] == "ascii";
    if (vertices_.is_text || (words.size() == 3 && words[1] == "binary_little_endian")) return "";
    return "its format must be binary_little_endian or ascii";
  }

  std::string TakeElement(const Words& words) {
    // Vertices must come first: their offset in the file is then that of the header's end.
    in_vertices_ = num_elements_++ == 0;
    if (!in_vertices_) return "";
    if (words.size() != 3 || words[1] != "vertex") return "its first element is not the vertices";
    if (!absl::SimpleAtoi(words[2], &vertices_.count) || vertices_.count < 0) {
      return "its number of vertices is malformed";
    }
    return "";
  }

  std::string TakeProperty(const Words& words) {
    const std::optional<PlyType> type =
        words.size() == 3 ? TypeByName(words[1]) : std::optional<PlyType>();
    if (!type) return "a property of its vertices is not a single number of a known type";
    if (vertices_.properties.size() >= kMaxProperties) return "has over 512 properties";
    // Columns are found by name, so names must be unique.
    if (vertices_.Find(words[2]) >= 0) return absl::StrCat("has two properties ", words[2]);
    vertices_.properties.push_back({std::string(words[2]), *type, vertices_.stride});
    vertices_.stride += SizeOf(*type);
    return "";
  }

  PlyVertices& vertices_;
  bool has_format_ = false;
  bool in_vertices_ = false;
  int num_elements_ = 0;
};

// Parses the lines between "ply" and "end_header".
absl::Status ParseHeader(absl::string_view header, PlyVertices& vertices) {
  HeaderParser parser(vertices);
  std::vector<absl::string_view> lines = absl::StrSplit(header, '\n', absl::SkipWhitespace());
  // OpenPly has found the first and the last line.
  lines.erase(lines.begin());  // "ply"
  lines.pop_back();            // "end_header"
  for (const absl::string_view line : lines) {
    const Words words = absl::StrSplit(absl::StripAsciiWhitespace(line), ' ', absl::SkipEmpty());
    const std::string wrong = parser.TakeLine(words);
    if (!wrong.empty()) return Refused(vertices.name, wrong);
  }
  const std::string wrong = parser.Finish();
  return wrong.empty() ? absl::OkStatus() : Refused(vertices.name, wrong);
}

// Returns the smallest number of bytes that a vertex can have. In text that is a digit and a
// separator for each property; the last vertex of the file may lack its line end.
int64_t LeastBytes(const PlyVertices& vertices) {
  return vertices.is_text ? 2 * static_cast<int64_t>(vertices.properties.size()) : vertices.stride;
}

// Returns the value with infinities limited as the column says.
float Limited(float value, const PlyColumn& column) {
  return std::isinf(value) && column.infinity > 0 ? std::copysign(column.infinity, value) : value;
}

absl::Status NotFinite(const PlyVertices& vertices, int64_t vertex, const PlyProperty& property) {
  return Refused(vertices.name,
                 absl::StrCat("vertex ", vertex, ": ", property.name, " is not finite"));
}

// Reads the vertices of an ASCII file line by line, with a limit for the length of a line.
absl::Status ReadTextColumns(const PlyVertices& vertices, std::span<const PlyColumn> columns) {
  std::ifstream file(vertices.path, std::ios::binary);
  file.seekg(vertices.data_offset);
  std::array<char, kMaxLineBytes> line{};
  for (int64_t row = 0; row < vertices.count; ++row) {
    // A longer line sets the stream's fail bit, and is reported as malformed.
    file.getline(line.data(), line.size());
    if (file.bad()) return absl::InternalError(absl::StrCat(vertices.name, ": cannot be read"));
    const auto no_vertex = [&] {
      return Refused(vertices.name, absl::StrCat("vertex ", row, ": its line is not ",
                                                 vertices.properties.size(), " numbers"));
    };
    if (!file) return no_vertex();
    const Words words = absl::StrSplit(absl::StripAsciiWhitespace(line.data()),
                                       absl::ByAnyChar(" \t"), absl::SkipEmpty());
    if (words.size() != vertices.properties.size()) return no_vertex();
    for (const PlyColumn& column : columns) {
      double number = 0;
      if (!absl::SimpleAtod(words[column.property], &number)) return no_vertex();
      // Subtracted in double: far from zero, a float has no digits left for the difference.
      float& value = column.values[row] =
          Limited(static_cast<float>(number - column.origin), column);
      const PlyProperty& property = vertices.properties[column.property];
      if (!std::isfinite(value)) return NotFinite(vertices, row, property);
    }
  }
  return absl::OkStatus();
}

}  // namespace

int PlyVertices::Find(absl::string_view property) const {
  const auto found = std::find_if(properties.begin(), properties.end(),
                                  [&](const PlyProperty& p) { return p.name == property; });
  return found == properties.end() ? -1 : static_cast<int>(found - properties.begin());
}

absl::StatusOr<PlyVertices> OpenPly(const std::filesystem::path& path, const std::string& name,
                                    int64_t max_vertices) {
  ASSIGN_OR_RETURN(const int64_t size, FileSize(path, name));
  std::ifstream file(path, std::ios::binary);
  std::string front(static_cast<size_t>(std::min(size, kMaxHeaderBytes)), '\0');
  file.read(front.data(), static_cast<std::streamsize>(front.size()));
  if (!file && !front.empty()) return absl::InternalError(absl::StrCat(name, ": cannot be read"));
  if (front.rfind("ply\n", 0) != 0 && front.rfind("ply\r\n", 0) != 0) {
    return Refused(name, "is not a PLY file");
  }
  const absl::string_view header = HeaderOf(front);
  if (header.empty()) return Refused(name, "its header has no end");
  PlyVertices vertices;
  vertices.path = path;
  vertices.name = name;
  vertices.data_offset = static_cast<int64_t>(header.size());
  RETURN_IF_ERROR(ParseHeader(header, vertices));
  if (vertices.count > max_vertices) {
    return Refused(
        name, absl::StrCat("declares ", vertices.count, " vertices, the limit is ", max_vertices));
  }
  // Before the caller allocates for the count.
  const int64_t least = LeastBytes(vertices);
  if (vertices.count > (size - vertices.data_offset + (vertices.is_text ? 1 : 0)) / least) {
    return Refused(
        name, absl::StrCat("declares ", vertices.count, " vertices of ", least, " bytes, but only ",
                           size - vertices.data_offset, " bytes follow its header"));
  }
  return vertices;
}

Eigen::Vector3d OffsetTo(const Eigen::Vector3d& origin, const PlyVertices& vertices) {
  return origin - vertices.origin;
}

absl::Status ReadColumns(const PlyVertices& vertices, std::span<const PlyColumn> columns) {
  if (vertices.is_text) return ReadTextColumns(vertices, columns);
  // Block by block, so that memory does not grow with the file.
  constexpr int64_t kBlockRows = 4096;
  std::ifstream file(vertices.path, std::ios::binary);
  file.seekg(vertices.data_offset);
  std::vector<char> block(static_cast<size_t>(kBlockRows) * vertices.stride);
  for (int64_t first = 0; first < vertices.count; first += kBlockRows) {
    const int64_t rows = std::min(kBlockRows, vertices.count - first);
    file.read(block.data(), rows * vertices.stride);
    if (!file) return absl::InternalError(absl::StrCat(vertices.name, ": cannot be read"));
    for (const PlyColumn& column : columns) {
      const PlyProperty& property = vertices.properties[column.property];
      for (int64_t row = 0; row < rows; ++row) {
        const char* at = block.data() + row * vertices.stride + property.offset;
        const float value =
            Limited(static_cast<float>(LoadAs(property.type, at) - column.origin), column);
        if (!std::isfinite(value)) {
          return NotFinite(vertices, first + row, property);
        }
        column.values[first + row] = value;
      }
    }
  }
  return absl::OkStatus();
}

absl::StatusOr<std::vector<ScenePoint>> ReadPlyPoints(const std::filesystem::path& path,
                                                      const std::string& name,
                                                      const Eigen::Vector3d& origin) {
  constexpr const char* kNames[] = {"x", "y", "z", "red", "green", "blue"};
  constexpr float kGrey = 128;
  ASSIGN_OR_RETURN(const PlyVertices vertices, OpenPly(path, name, kMaxPoints));
  std::vector<std::vector<float>> values(6);
  const Eigen::Vector3d offset = OffsetTo(origin, vertices);
  std::vector<PlyColumn> columns;
  for (int i = 0; i < 6; ++i) {
    // Colours are optional: points without them are grey.
    values[i].assign(static_cast<size_t>(vertices.count), kGrey);
    const int property = vertices.Find(kNames[i]);
    if (property >= 0) {
      columns.push_back({property, values[i], i < 3 ? offset[i] : 0});
    } else if (i < 3) {
      return absl::InvalidArgumentError(absl::StrCat(name, ": has no property ", kNames[i]));
    }
  }
  RETURN_IF_ERROR(ReadColumns(vertices, columns));
  std::vector<ScenePoint> points(static_cast<size_t>(vertices.count));
  for (size_t row = 0; row < points.size(); ++row) {
    for (int i = 0; i < 3; ++i) {
      points[row].position[i] = values[i][row];
      points[row].rgb[i] =
          static_cast<uint8_t>(std::lround(std::clamp(values[3 + i][row], 0.0f, 255.0f)));
    }
  }
  return points;
}

}  // namespace pepeseg
