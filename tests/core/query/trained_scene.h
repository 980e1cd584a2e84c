#pragma once

#include <cstdint>
#include <vector>

#include "absl/status/statusor.h"
#include "core/query/prompt.h"
#include "core/scene/model.h"
#include "tests/testing/synthetic_capture.h"

namespace pepeseg::testing {

// The synthetic scene with 20,000 points, and in each view a mask for the table with its backdrop
// too, as an automatic mask generator gives one. Without it nothing would teach what lies beside an
// object.
SyntheticScene FullyMaskedScene();

// Both stages in a few seconds, with the capture's views. The same model on every call.
absl::StatusOr<Model> TrainModel(const SyntheticScene& scene);

// The one-click protocol's prompt: the pixel deepest inside an object, by its distance to the
// nearest pixel (or border) that is not the object's.
PointPrompt DeepestPoint(const std::vector<uint8_t>& labels, int label, int width);

}  // namespace pepeseg::testing
