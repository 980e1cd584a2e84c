#pragma once

#include <vector>

#include "core/render/frozen_scene.h"
#include "core/scene/capture.h"

namespace pepeseg {

// How far the feature of each Gaussian is to be believed, (0, 1]: the number of training views with
// masks that show it, of up to 64 of them, as a share of sure_views or of a sixth of them, what is
// more, squared. What hangs before a camera or two, to make up there for what the scene lacks,
// has a feature that suits those views alone, and in a view beyond them lies before all else; not
// in the paper.
std::vector<float> FeatureConfidence(const Capture& capture, FrozenScene& scene, int sure_views);

}  // namespace pepeseg
