#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "core/scene/capture.h"

namespace pepeseg {

// Parses a portable float map of one channel: "Pf", width, height and a scale as text, then floats
// with the bottom scanline first. A negative scale means that they are little-endian; its magnitude
// is ignored. Returns the top scanline first. INVALID_ARGUMENT, naming `name`: the file has another
// format, exceeds kMaxImagePixels, or is shorter than its size needs.
absl::StatusOr<FloatImage> ParsePfm(absl::string_view name, absl::string_view bytes);

}  // namespace pepeseg
