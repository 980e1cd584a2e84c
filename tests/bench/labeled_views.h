#pragma once

#include <vector>

#include "core/evaluate/labeled_view.h"
#include "core/scene/capture.h"
#include "tests/bench/capture_pack.h"

namespace pepeseg {

// Returns the held-out views of a capture that a level of ground truth labels.
std::vector<LabeledView> LabeledViews(const Capture& capture, const TruthLevel& level);

}  // namespace pepeseg
