#pragma once

#include "absl/status/status.h"

namespace pepeseg {

// What makes masks or depth maps where a dataset has none of them.
enum class PriorMaker {
  kAuto = 0,  // the command where there is one and it succeeds, else what is embedded
  kNone = 1,
  kEmbedded = 2,
  kCommand = 3,  // the operator's program, or the job fails
};

struct PriorOptions {
  PriorMaker masks = PriorMaker::kAuto;
  PriorMaker depth = PriorMaker::kAuto;
};
// INVALID_ARGUMENT: a maker that is none of these.
absl::Status Validate(const PriorOptions& options);

}  // namespace pepeseg
