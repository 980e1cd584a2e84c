#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/scene/capture.h"
#include "tests/testing/crowded_surfaces.h"

namespace pepeseg::testing {

struct CrowdedOptions {
  int num_views = 36;  // on an arc of 100 degrees
  int width = 240;
  int height = 180;
  int held_out_every = 8;   // holds out the first view and every n-th after it; 0: none
  int num_points = 4000;    // coloured points on the surfaces
  double mask_drop = 0.25;  // probability that a mask is missing in a view
  uint64_t seed = 1;        // decides which masks are missing
};

// Minimum area of a part or object, pixels, for a mask in a view.
inline constexpr int64_t kMinMaskArea = 30;

// Ground truth of one granularity level.
struct CrowdedLevel {
  std::vector<std::string> entities;          // names by label; empty for 0, table and screen
  std::vector<std::vector<uint16_t>> labels;  // by view, [height, width], at the pixels' centres
};

// A scene that is hard for the perception loss as the paper has it: many small parts that touch and
// look alike, and every view lacks some of their masks.
struct CrowdedScene {
  Capture capture;  // masks of parts, then of objects, in the order of the labels
  CrowdedLevel parts, objects;
  std::vector<uint16_t> object_of_part;
};

// Makes the ray-traced scene of crowded_surfaces.h, with disparity as a monocular network gives it:
// a smooth error of a few per cent, and 8 bits. Returns the same bytes on every call.
CrowdedScene MakeCrowdedScene(const CrowdedOptions& options = {});
// Makes the scene of other surfaces in the same way.
CrowdedScene MakeSceneOf(CrowdedSurfaces world, const CrowdedOptions& options);

}  // namespace pepeseg::testing
