#pragma once

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "nlohmann/json_fwd.hpp"

namespace pepeseg {

// Maximum nesting of arrays and objects in a JSON file. Each level takes about 80 bytes of memory
// in nlohmann's parser, so that 64 MiB of '[' would take 5 GiB.
inline constexpr int kMaxJsonDepth = 64;

// Parses the text of a JSON file. Returns INVALID_ARGUMENT "is not JSON, or cut short" or "is
// nested deeper than 64 levels". The nesting is checked by a first pass that allocates nothing for
// it. The caller adds the file's name to the message.
absl::StatusOr<nlohmann::json> ParseFileJson(absl::string_view text);

}  // namespace pepeseg
