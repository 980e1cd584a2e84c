#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/strings/string_view.h"
#include "core/scene/model.h"

namespace pepeseg {

// What of a model is neither Gaussians nor features, as JSON (model.json):
//   {"version": 1, "scene_radius": 1.5, "origin": [x, y, z], "metrics": {...}, "facts": {...},
//    "views": [{"name": "...", "width": 640, "height": 480, "focal": [fx, fy],
//               "principal_point": [cx, cy], "rotation": [w, x, y, z],
//               "translation": [x, y, z], "held_out": true,
//               "scores": {"psnr": 24.1, "ssim": 0.81, "lpips": 0.2}}]}
// Rotation and translation are cam_from_world, relative to the origin; without one it is zero. The
// model's PLY is in the world of the dataset. A metric that is not finite is left out; so are
// scores where there are none.
std::string FormatModelFacts(const Model& model);

// Fills the same parts of `model`. DATA_LOSS names what is malformed.
absl::Status ParseModelFacts(absl::string_view text, Model& model);

}  // namespace pepeseg
