#pragma once

#include "core/model_files/model_file.h"
#include "kernels/backend.h"
#include "server/residency/memory_budget.h"

namespace pepeseg {

// Returns an upper bound of what a Segmenter of such a model takes on the host and on the backend:
// Gaussians and features, the decompositions and feature maps that it may keep, and the scratch of
// a render of MostPixels pixels (Backend::ScratchBytes). What a single query takes in addition,
// such as blend rows or a larger view, is not counted: it is freed with the query.
MemoryBytes BytesOfModel(const Backend& backend, const ModelShape& shape);

}  // namespace pepeseg
