#pragma once

#include <cstddef>

#include "absl/status/status.h"

namespace pepeseg {

// What a client takes in one message.
inline constexpr size_t kAnswerBytes = size_t{4} << 20;

// RESOURCE_EXHAUSTED: over kAnswerBytes.
absl::Status CheckAnswerSize(size_t num_bytes);

}  // namespace pepeseg
