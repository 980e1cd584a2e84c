#include "tests/bench/labeled_views.h"

#include <cstddef>

namespace pepeseg {

std::vector<LabeledView> LabeledViews(const Capture& capture, const TruthLevel& level) {
  std::vector<LabeledView> labeled;
  for (size_t v = 0; v < capture.views.size(); ++v) {
    const View& view = capture.views[v];
    if (!view.held_out || level.labels[v].empty()) continue;
    labeled.push_back(
        {{view.name, view.camera, view.cam_from_world, true}, level.labels[v], view.ignore});
  }
  return labeled;
}

}  // namespace pepeseg
