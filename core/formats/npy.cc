#include "core/formats/npy.h"

#include <cstdint>
#include <optional>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "core/base/byte_reader.h"
#include "core/base/errors.h"
#include "core/base/status_macros.h"
#include "core/formats/image_header.h"
#include "kernels/half.h"

namespace pepeseg {
namespace {

constexpr absl::string_view kMagic("\x93NUMPY", 6);

// Returns the text of the header, a Python dict, and moves the reader to the values. Returns
// nothing if the header is cut short or its version is unknown.
std::optional<absl::string_view> TakeHeader(absl::string_view bytes, ByteReader& reader) {
  reader.Skip(kMagic.size());
  const auto major = reader.Take<uint8_t>();
  reader.Skip(1);
  // Versions 2 and 3 have a length of 32 bits.
  const uint32_t length = major == 1 ? reader.Take<uint16_t>() : reader.Take<uint32_t>();
  const size_t start = reader.offset();
  if (major < 1 || major > 3 || !reader.Skip(length)) return std::nullopt;
  return bytes.substr(start, length);
}

// Returns the text after 'key': in the header, up to the next comma outside of brackets or to the
// closing brace.
std::optional<absl::string_view> ValueOf(absl::string_view header, absl::string_view key) {
  // NumPy writes {'descr': '<f4', 'fortran_order': False, 'shape': (480, 640), }.
  const std::string quoted = absl::StrCat("'", key, "':");
  const size_t found = header.find(quoted);
  if (found == absl::string_view::npos) return std::nullopt;
  header.remove_prefix(found + quoted.size());
  int depth = 0;
  for (size_t i = 0; i < header.size(); ++i) {
    if (depth == 0 && (header[i] == ',' || header[i] == '}')) {
      return absl::StripAsciiWhitespace(header.substr(0, i));
    }
    depth += header[i] == '(' || header[i] == '[' ? 1 : 0;
    depth -= header[i] == ')' || header[i] == ']' ? 1 : 0;
  }
  return std::nullopt;
}

struct Shape {
  uint64_t height = 0, width = 0;
};

// Parses "(480, 640)" into as many sizes. Returns an empty list if the text is malformed.
std::vector<uint64_t> ParseSizes(absl::string_view text) {
  if (!absl::ConsumePrefix(&text, "(") || !absl::ConsumeSuffix(&text, ")")) return {};
  std::vector<uint64_t> sizes;
  for (const absl::string_view size : absl::StrSplit(text, ',')) {
    if (!absl::SimpleAtoi(size, &sizes.emplace_back())) return {};
  }
  return sizes;
}

std::optional<Shape> ParseShape(absl::string_view text) {
  const std::vector<uint64_t> sizes = ParseSizes(text);
  if (sizes.size() != 2) return std::nullopt;
  return Shape{sizes[0], sizes[1]};
}

// Checks the size of the array. The single comparisons keep the product from overflowing.
absl::Status CheckShape(absl::string_view name, const Shape& shape) {
  if (shape.width == 0 || shape.height == 0) return Refused(name, "an empty array");
  if (shape.width > kMaxImagePixels || shape.height > kMaxImagePixels ||
      shape.width * shape.height > static_cast<uint64_t>(kMaxImagePixels)) {
    return Refused(name, absl::StrCat(shape.width, "x", shape.height, " pixels, the limit is ",
                                      kMaxImagePixels));
  }
  return absl::OkStatus();
}

template <class Value, class T>
Value Decode(T value) {
  return static_cast<Value>(value);
}

template <class Value>
Value Decode(Half value) {
  return FloatFromHalf(value);
}

// Reads `count` values of type T. Returns false, before allocating, if too few bytes follow.
template <class T, class Value>
bool TakeValues(ByteReader& reader, size_t count, std::vector<Value>& values) {
  if (reader.remaining() / sizeof(T) < count) return false;
  values.reserve(count);
  for (size_t i = 0; i < count; ++i) values.push_back(Decode<Value>(reader.Take<T>()));
  return true;
}

// Reads the values. Returns nothing if `type` is not supported, false if too few bytes follow.
template <class Value>
std::optional<bool> TakeArray(absl::string_view type, const Shape& shape, ByteReader& reader,
                              std::vector<Value>& values) {
  const size_t count = shape.width * shape.height;
  if (type == "'<f2'") return TakeValues<Half>(reader, count, values);
  if (type == "'<f4'") return TakeValues<float>(reader, count, values);
  if (type == "'<f8'") return TakeValues<double>(reader, count, values);
  if (type == "'|u1'") return TakeValues<uint8_t>(reader, count, values);
  if (type == "'<u2'") return TakeValues<uint16_t>(reader, count, values);
  if (type == "'<u4'") return TakeValues<uint32_t>(reader, count, values);
  return std::nullopt;
}

// What the header says of an array, as text.
struct HeaderFields {
  absl::string_view type, shape;
};

// Reads the header and moves the reader to the values.
absl::StatusOr<HeaderFields> ReadHeader(absl::string_view name, absl::string_view bytes,
                                        ByteReader& reader) {
  if (!absl::StartsWith(bytes, kMagic)) return Refused(name, "not an NPY file");
  const auto header = TakeHeader(bytes, reader);
  if (!header) return Refused(name, "the NPY header is cut short or of an unknown version");
  const auto type = ValueOf(*header, "descr");
  const auto order = ValueOf(*header, "fortran_order");
  const auto sizes = ValueOf(*header, "shape");
  if (!type || !order || !sizes) return Refused(name, "the NPY header is malformed");
  // C order: scanline after scanline, as FloatImage has it.
  if (*order != "False") return Refused(name, "the array must be in C order");
  return HeaderFields{*type, *sizes};
}

// Parses a file into `values` and returns the array's shape.
template <class Value>
absl::StatusOr<Shape> ParseArray(absl::string_view name, absl::string_view bytes,
                                 std::vector<Value>& values) {
  ByteReader reader(bytes);
  ASSIGN_OR_RETURN(const HeaderFields header, ReadHeader(name, bytes, reader));
  const std::optional<Shape> shape = ParseShape(header.shape);
  if (!shape) return Refused(name, "the array must have the shape (height, width)");
  RETURN_IF_ERROR(CheckShape(name, *shape));
  const std::optional<bool> whole = TakeArray(header.type, *shape, reader, values);
  if (!whole) return Refused(name, "the array must be of <f2, <f4, <f8, |u1, <u2 or <u4");
  if (!*whole) {
    return Refused(name, absl::StrCat("cut short: too few bytes for ", shape->width, "x",
                                      shape->height, " values"));
  }
  return *shape;
}

}  // namespace

absl::StatusOr<FloatImage> ParseNpy(absl::string_view name, absl::string_view bytes) {
  FloatImage image;
  ASSIGN_OR_RETURN(const Shape shape, ParseArray(name, bytes, image.values));
  image.width = static_cast<int>(shape.width);
  image.height = static_cast<int>(shape.height);
  return image;
}

absl::StatusOr<NpyTable> ParseNpyTable(absl::string_view name, absl::string_view bytes) {
  NpyTable table;
  ASSIGN_OR_RETURN(const Shape shape, ParseArray(name, bytes, table.values));
  table.num_columns = static_cast<int>(shape.width);
  table.num_rows = static_cast<int>(shape.height);
  return table;
}

absl::StatusOr<NpyStack> ParseNpyStack(absl::string_view name, absl::string_view bytes) {
  ByteReader reader(bytes);
  ASSIGN_OR_RETURN(const HeaderFields header, ReadHeader(name, bytes, reader));
  const std::vector<uint64_t> sizes = ParseSizes(header.shape);
  if (sizes.size() != 3) {
    return Refused(name, "the array must have the shape (masks, height, width)");
  }
  if (header.type != "'|b1'" && header.type != "'|u1'") {
    return Refused(name, "the array must be of |b1 or |u1");
  }
  RETURN_IF_ERROR(CheckShape(name, {sizes[1], sizes[2]}));
  // The division keeps the product from overflowing.
  const absl::string_view values = bytes.substr(reader.offset());
  if (sizes[0] > values.size() / (sizes[1] * sizes[2])) {
    return Refused(name, absl::StrCat("cut short: too few bytes for ", sizes[0], " images of ",
                                      sizes[2], "x", sizes[1], " values"));
  }
  return NpyStack{static_cast<int>(sizes[0]), static_cast<int>(sizes[1]),
                  static_cast<int>(sizes[2]), values};
}

}  // namespace pepeseg
