#pragma once

#include <cstddef>

#include "absl/status/status.h"

namespace pepeseg {

// RESOURCE_EXHAUSTED: over the 4 MiB that a client takes in one message.
absl::Status CheckAnswerSize(size_t num_bytes);

}  // namespace pepeseg
