#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "core/dataset/mask_files.h"
#include "core/scene/capture.h"

namespace pepeseg {

// Parses a portable float map of one channel: "Pf", width, height and a scale as text, then floats
// with the bottom scanline first. A negative scale means that they are little-endian; its magnitude
// is ignored. Returns the top scanline first. INVALID_ARGUMENT, naming `name`: the file has another
// format, exceeds kMaxImagePixels, or is shorter than its size needs.
absl::StatusOr<FloatImage> ParsePfm(absl::string_view name, absl::string_view bytes);

// Reads the depth map of a photograph. Its format follows from the suffix of `name`:
//   .png  grey, 8 or 16 bit     .npy  see npy.h     .pfm  see ParsePfm
// Returns NaN for unknown depth, which is 0 in a map of kind kDepth. In a disparity map 0 is known
// and infinitely far. The map may be larger or smaller than the photograph if their aspect ratios
// agree within 1 %. INVALID_ARGUMENT, naming the file: it is malformed or cut short, exceeds
// 64 Mpx, has another aspect ratio, or has a value that is not finite (the first pixel is named).
absl::StatusOr<FloatImage> ReadDepthMap(const std::filesystem::path& path, const std::string& name,
                                        DepthPrior::Kind kind, const PhotoSize& photo);

}  // namespace pepeseg
