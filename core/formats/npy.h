#pragma once

#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "core/scene/capture.h"

namespace pepeseg {

// A two-dimensional array [height, width] in NumPy's .npy format, versions 1 to 3: little-endian
// floats of 2, 4 or 8 bytes or unsigned integers of 1, 2 or 4, in C order. Doubles beyond
// float's range become infinite. INVALID_ARGUMENT with `name`: another file, type,
// order or shape; over kMaxImagePixels; fewer bytes than the shape needs.
absl::StatusOr<FloatImage> ParseNpy(absl::string_view name, absl::string_view bytes);

// A table of numbers in the same format, in the precision that the file has.
struct NpyTable {
  int num_rows = 0, num_columns = 0;
  std::vector<double> values;  // [num_rows, num_columns]
};
// Of the same types, with the same errors and limits.
absl::StatusOr<NpyTable> ParseNpyTable(absl::string_view name, absl::string_view bytes);

}  // namespace pepeseg
