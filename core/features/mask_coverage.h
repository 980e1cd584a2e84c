#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/render/frozen_scene.h"
#include "core/scene/capture.h"

namespace pepeseg {

// Pixels that no mask of their view covers, on a grid of the view, none of them ignored and each
// with something rendered on it: y * width + x. An uncovered pixel alone says little, because a
// mask may just be missing in its view; the Gaussians that it shows tell how often masks covered
// them.
struct UncoveredPixels {
  std::vector<int32_t> background;         // hardly any mask covers what they show in any view
  std::vector<int32_t> covered_elsewhere;  // the others
};
// Of each view, by the masks that it learns from; none of held-out views and views without masks.
std::vector<UncoveredPixels> FindUncovered(const Capture& capture,
                                           std::span<const MaskSet* const> masks,
                                           FrozenScene& scene);

}  // namespace pepeseg
