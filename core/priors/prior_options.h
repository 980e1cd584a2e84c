#pragma once

#include "absl/status/status.h"

namespace pepeseg {

// Source of masks or depth maps for a dataset that brings none.
enum class PriorMaker {
  // The operator's command if there is one and it succeeds; else SAM, for masks and where it is
  // installed; else the built-in method.
  kAuto = 0,
  kNone = 1,
  kEmbedded = 2,        // the built-in method, see embed_priors.h
  kCommand = 3,         // the operator's command; the job fails if it does
  kSam = 4,             // masks only: a small SAM, see sam/sam_segmenter.h
  kSamAndEmbedded = 5,  // masks only: SAM's and the built-in ones, without duplicates
};

// Returns true for kSam and kSamAndEmbedded.
bool AsksForSam(PriorMaker maker);

// Options of the priors stage.
struct PriorOptions {
  PriorMaker masks = PriorMaker::kAuto;
  PriorMaker depth = PriorMaker::kAuto;
};
// Returns INVALID_ARGUMENT for a value outside the enum, and for SAM as the maker of depth.
absl::Status Validate(const PriorOptions& options);

}  // namespace pepeseg
