#include "core/train/training_scene.h"

#include <algorithm>

namespace pepeseg {

bool HasKind(std::span<const DatasetFile> files, FileKind kind) {
  return std::any_of(files.begin(), files.end(),
                     [kind](const DatasetFile& file) { return file.kind == kind; });
}

StageLog::Metrics Counts(const Capture& capture) {
  double num_masks = 0, num_depth_maps = 0;
  for (const View& view : capture.views) {
    num_masks += view.masks.num_masks;
    num_depth_maps += view.depth.values.empty() ? 0 : 1;
  }
  return {{"num_views", static_cast<double>(capture.views.size())},
          {"num_points", static_cast<double>(capture.points.size())},
          {"num_masks", num_masks},
          {"num_depth_maps", num_depth_maps}};
}

}  // namespace pepeseg
