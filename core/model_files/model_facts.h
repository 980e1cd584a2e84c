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
//               "scores": {"psnr": 24.1, "ssim": 0.81, "lpips": 0.2},
//               "photograph": {"lens": "OPENCV", "width": 1280, "height": 960,
//                              "focal": [fx, fy], "principal_point": [cx, cy],
//                              "distortion": [k1, k2, p1, p2, 0, 0, 0, 0],
//                              "orientation": 6, "part": [left, top, width, height]}}]}
// Rotation and translation are cam_from_world, relative to the origin; without one it is zero. The
// model's PLY is in the world of the dataset. A metric that is not finite is left out; so are
// scores and the photograph where there are none, as in models that older versions wrote. They
// ignore the keys that they do not know.
std::string FormatModelFacts(const Model& model);

// Fills the same parts of `model`. DATA_LOSS names what is malformed.
absl::Status ParseModelFacts(absl::string_view text, Model& model);

}  // namespace pepeseg
