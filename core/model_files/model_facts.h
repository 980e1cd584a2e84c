#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/strings/string_view.h"
#include "core/scene/model.h"

namespace pepeseg {

// Formats the metadata of a model, which is everything but its Gaussians and features, as JSON.
// Stored as model.json:
//   {"version": 1, "scene_radius": 1.5, "origin": [x, y, z], "metrics": {...}, "facts": {...},
//    "views": [{"name": "...", "width": 640, "height": 480, "focal": [fx, fy],
//               "principal_point": [cx, cy], "rotation": [w, x, y, z],
//               "translation": [x, y, z], "held_out": true,
//               "scores": {"psnr": 24.1, "ssim": 0.81, "lpips": 0.2},
//               "photograph": {"lens": "OPENCV", "width": 1280, "height": 960,
//                              "focal": [fx, fy], "principal_point": [cx, cy],
//                              "distortion": [k1, k2, p1, p2, 0, 0, 0, 0],
//                              "orientation": 6, "part": [left, top, width, height]}}]}
// "rotation" and "translation" are cam_from_world relative to the origin, which is zero if "origin"
// is missing. (The model's PLY file is in the world of the dataset.) Metrics that are not finite,
// missing scores and missing photographs are left out. Unknown keys are ignored, so that a key can
// be added without a new version.
std::string FormatModelFacts(const Model& model);

// Parses such a text and sets the metadata of `model`. DATA_LOSS, naming the key or view: it is
// malformed.
absl::Status ParseModelFacts(absl::string_view text, Model& model);

}  // namespace pepeseg
