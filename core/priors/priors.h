#pragma once

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "core/base/options.h"
#include "core/scene/capture.h"

namespace pepeseg {

// Source of masks or depth maps for a dataset that brings none.
enum class PriorMaker {
  // The operator's command if there is one and it succeeds; else SAM, for masks and where it is
  // installed; else the built-in method. Depth is then made with built-in masks only, which it
  // gives better borders: next to other masks it gains nothing
  // (tests/bench/results/bare_photographs.md).
  kAuto = 0,
  kNone = 1,
  kEmbedded = 2,        // the built-in method, see EmbedPriors
  kCommand = 3,         // the operator's command; the job fails if it does
  kSam = 4,             // masks only: a small SAM, see sam/sam_segmenter.h
  kSamAndEmbedded = 5,  // masks only: SAM's and the built-in ones, without duplicates
};

// Returns true for kSam and kSamAndEmbedded.
bool AsksForSam(PriorMaker maker);
// Returns true if SAM is expected to make the masks: where it is installed and either asked for, or
// free to be used and the operator has no command. It also makes them if a command fails, which is
// not expected.
bool ExpectsSam(PriorMaker masks, bool has_command, bool has_sam);

// Options of the priors stage.
struct PriorOptions {
  // Maker of the masks of a dataset that has none, or whose masks are not used.
  PriorMaker masks = PriorMaker::kAuto;
  // Maker of the depth maps of a dataset that has none, or whose maps are not used. Never SAM.
  PriorMaker depth = PriorMaker::kAuto;
};
// Passes each option with its words to `visit`.
void VisitOptions(PriorOptions& options, OptionVisitor visit);
// Returns INVALID_ARGUMENT for a value outside the enum, and for SAM as the maker of depth.
absl::Status Validate(const PriorOptions& options);

// Priors to compute.
struct EmbeddedPriors {
  bool masks = false, depth = false;
};

// Computes masks and depth without a network (embedded_masks.h, embedded_depth.h) for each training
// view that has none; depth first, because it helps to find the masks' borders. Held-out views are
// left as they are. Works on `num_threads` views at a time; the result does not depend on it.
// Calls `progress` on the caller's thread after each group of views; an error that it returns ends
// the call with that error, and the views done so far keep their priors.
absl::Status EmbedPriors(const EmbeddedPriors& what, int num_threads, Capture& capture,
                         absl::FunctionRef<absl::Status(int done, int num_views)> progress);

}  // namespace pepeseg
