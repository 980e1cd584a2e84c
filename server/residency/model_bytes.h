#pragma once

#include "core/model_files/model_file.h"
#include "kernels/backend.h"
#include "server/residency/memory_budget.h"

namespace pepeseg {

// What a Segmenter of such a model takes at most, once on the host and once on the backend: its
// Gaussians and features, the decompositions and feature maps that it may keep, and the scratch of
// a render of MostPixels as Backend::ScratchBytes tells it. What a question takes on top, as for
// the rows of pixels or for a larger view, goes with it.
MemoryBytes BytesOfModel(const Backend& backend, const ModelShape& shape);

}  // namespace pepeseg
