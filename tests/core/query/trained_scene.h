#pragma once

#include <cstdint>
#include <vector>

#include "absl/status/statusor.h"
#include "core/query/prompt.h"
#include "core/scene/model.h"
#include "tests/testing/synthetic_capture.h"

namespace pepeseg::testing {

// Returns the synthetic scene with 20,000 points, and in each view also a mask of the table with
// its backdrop, as an automatic mask generator makes one. Without that mask, no loss would separate
// an object from its surroundings.
SyntheticScene FullyMaskedScene();

// Trains both stages in a few seconds on the capture's views. Returns the same model on every call.
absl::StatusOr<Model> TrainModel(const SyntheticScene& scene);

// Returns the prompt of the one-click protocol: the pixel deepest inside an object, by its distance
// to the nearest pixel (or image border) outside the object.
PointPrompt DeepestPoint(const std::vector<uint8_t>& labels, int label, int width);

}  // namespace pepeseg::testing
