#pragma once

#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "core/scene/capture.h"

namespace pepeseg {

// Parses a two-dimensional array [height, width] in NumPy's .npy format, versions 1 to 3. Supports
// little-endian floats of 2, 4 or 8 bytes and unsigned integers of 1, 2 or 4 bytes, in C order.
// Doubles beyond the range of float become infinite. INVALID_ARGUMENT, naming `name`: the file has
// another format, type, order or number of dimensions, exceeds kMaxImagePixels, or is shorter than
// its shape needs.
absl::StatusOr<FloatImage> ParseNpy(absl::string_view name, absl::string_view bytes);

// A two-dimensional array in double precision.
struct NpyTable {
  int num_rows = 0, num_columns = 0;
  std::vector<double> values;  // [num_rows, num_columns]
};
// Parses such an array without rounding doubles to float. Types, errors and limits as ParseNpy.
absl::StatusOr<NpyTable> ParseNpyTable(absl::string_view name, absl::string_view bytes);

// A three-dimensional array of booleans or bytes.
struct NpyStack {
  int num_images = 0, height = 0, width = 0;
  absl::string_view values;  // [num_images, height, width], one byte each; part of the parsed bytes
};
// Parses an array [images, height, width] of booleans or unsigned integers of one byte, without
// copying the values. INVALID_ARGUMENT as ParseNpy, with kMaxImagePixels for each image.
absl::StatusOr<NpyStack> ParseNpyStack(absl::string_view name, absl::string_view bytes);

}  // namespace pepeseg
