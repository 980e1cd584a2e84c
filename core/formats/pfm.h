#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "core/scene/capture.h"

namespace pepeseg {

// A portable float map of one channel: "Pf", width, height and a scale as text, then floats, the
// bottom row first; a negative scale says that they are little-endian. Its size is left out of
// account. INVALID_ARGUMENT with `name`: another file; over kMaxImagePixels; fewer bytes than the
// size needs.
absl::StatusOr<FloatImage> ParsePfm(absl::string_view name, absl::string_view bytes);

}  // namespace pepeseg
