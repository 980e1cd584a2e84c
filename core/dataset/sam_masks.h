#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "core/dataset/mask_files.h"
#include "core/formats/file_json.h"
#include "core/scene/mask_set.h"

namespace pepeseg {

// Arrays and objects in each other that a file of SAM's may have, its own list included.
inline constexpr int kMaxMaskJsonDepth = kMaxJsonDepth;

// The masks in the text of a file that SAM's automatic mask generator has written (mask_files.h).
// The text is read once, a mask at a time: besides it and the answer, one mask's runs and pixels
// are in memory, however the text is made. INVALID_ARGUMENT names the file and the mask.
absl::StatusOr<MaskSet> ParseSamMasks(absl::string_view text, const std::string& name,
                                      const PhotoSize& photo);

}  // namespace pepeseg
