#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/evaluate/evaluation_task.h"
#include "core/scene/capture.h"
#include "tests/bench/capture_pack.h"

namespace pepeseg {

// Returns the held-out views of a capture that a level of ground truth labels. The name of an
// entity is its id in five digits, so that entities are sorted by id.
absl::StatusOr<std::vector<TruthView>> TruthViews(const Capture& capture, const TruthLevel& level);

// Returns the id of an entity of TruthViews.
int IdOf(const std::string& entity);

// Returns the mask of an entity, [height, width] of 0 and 1; no pixel if the view does not show it.
std::vector<uint8_t> MaskIn(const TruthView& truth, const std::string& entity);

}  // namespace pepeseg
