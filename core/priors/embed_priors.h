#pragma once

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "core/scene/capture.h"

namespace pepeseg {

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
