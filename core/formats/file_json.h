#pragma once

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "nlohmann/json_fwd.hpp"

namespace pepeseg {

// Levels of arrays and objects in a JSON file. Each level that nlohmann parses takes some 80 bytes
// of memory, so that 64 MiB of '[' would take 5 GiB.
inline constexpr int kMaxJsonDepth = 64;

// Parses the text of a JSON file. INVALID_ARGUMENT: "is not JSON, or cut short", or "is nested
// deeper than 64 levels", which is found without memory for what is nested.
absl::StatusOr<nlohmann::json> ParseFileJson(absl::string_view text);

}  // namespace pepeseg
