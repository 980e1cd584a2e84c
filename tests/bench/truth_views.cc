#include "tests/bench/truth_views.h"

#include <cstddef>
#include <cstdlib>
#include <map>
#include <set>
#include <utility>

#include "absl/strings/str_format.h"
#include "core/base/status_macros.h"

namespace pepeseg {

absl::StatusOr<std::vector<TruthView>> TruthViews(const Capture& capture, const TruthLevel& level) {
  std::vector<TruthView> truths;
  for (size_t v = 0; v < capture.views.size(); ++v) {
    const View& view = capture.views[v];
    const std::vector<uint16_t>& labels = level.labels[v];
    if (!view.held_out || labels.empty()) continue;
    std::map<int, std::string> names;
    for (const uint16_t id : std::set<uint16_t>(labels.begin(), labels.end())) {
      names[id] = absl::StrFormat("%05d", id);
    }
    TruthViewBuilder builder({view.name, view.camera, view.cam_from_world, true});
    RETURN_IF_ERROR(builder.AddLabels(labels, names));
    if (!view.ignore.empty()) RETURN_IF_ERROR(builder.AddIgnore(view.ignore));
    truths.push_back(std::move(builder).Build());
  }
  return truths;
}

int IdOf(const std::string& entity) { return std::atoi(entity.c_str()); }

std::vector<uint8_t> MaskIn(const TruthView& truth, const std::string& entity) {
  std::vector<uint8_t> mask = truth.MaskOf(entity);
  const Camera& camera = truth.view.camera;
  mask.resize(static_cast<size_t>(camera.width) * camera.height);
  return mask;
}

}  // namespace pepeseg
