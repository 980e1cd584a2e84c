#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "core/dataset/mask_files.h"
#include "core/formats/file_json.h"
#include "core/scene/mask_set.h"

namespace pepeseg {

// Maximum nesting of arrays and objects in a file of masks, including the outermost list.
inline constexpr int kMaxMaskJsonDepth = kMaxJsonDepth;

// Parses a file of SAM's automatic mask generator (see mask_files.h for the format). Reads the text
// once, one mask at a time: in addition to the text and the result, it holds the runs and pixels of
// one mask in memory, whatever the text contains. INVALID_ARGUMENT, naming the file and the mask:
// as ReadMasks.
absl::StatusOr<MaskSet> ParseSamMasks(absl::string_view text, const std::string& name,
                                      const PhotoSize& photo);

}  // namespace pepeseg
