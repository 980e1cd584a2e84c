#pragma once

#include "absl/status/status.h"

namespace pepeseg {

// What makes masks or depth maps where a dataset has none of them.
enum class PriorMaker {
  // The command where there is one and it succeeds; else, for masks and where SAM is installed,
  // SAM; else what is embedded.
  kAuto = 0,
  kNone = 1,
  kEmbedded = 2,
  kCommand = 3,         // the operator's program, or the job fails
  kSam = 4,             // masks only: a small SAM, see sam/sam_segmenter.h
  kSamAndEmbedded = 5,  // masks only: both, without what is in both
};

// Whether SAM is asked for by name, alone or with what is embedded.
bool AsksForSam(PriorMaker maker);

struct PriorOptions {
  PriorMaker masks = PriorMaker::kAuto;
  PriorMaker depth = PriorMaker::kAuto;
};
// INVALID_ARGUMENT: a maker that is none of these.
absl::Status Validate(const PriorOptions& options);

}  // namespace pepeseg
