#pragma once

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "core/scene/capture.h"

namespace pepeseg {

// What is to be made.
struct EmbeddedPriors {
  bool masks = false, depth = false;
};

// Gives the views that are trained on masks and depth without any network, see embedded_masks.h and
// embedded_depth.h, where they have none; depth first, as it shows where things end. Held-out views
// need neither. `progress` is told how many views are done, of how many; its error ends the call.
absl::Status EmbedPriors(const EmbeddedPriors& what, int num_threads, Capture& capture,
                         absl::FunctionRef<absl::Status(int done, int num_views)> progress);

}  // namespace pepeseg
