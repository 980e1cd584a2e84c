#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/scene/capture.h"

namespace pepeseg::testing {

struct CrowdedOptions {
  int num_views = 36;  // on an arc of 100 degrees
  int width = 240;
  int height = 180;
  int held_out_every = 8;   // from the first; 0: none
  int num_points = 4000;    // on the surfaces, coloured
  double mask_drop = 0.25;  // probability for a mask to be missing in a view
  uint64_t seed = 1;        // of the missing masks
};

// Parts and objects that show less have no mask in that view, pixels.
inline constexpr int64_t kMinMaskArea = 30;

// Ground truth of one level.
struct CrowdedLevel {
  std::vector<std::string> entities;          // names by label; 0, table and screen, has none
  std::vector<std::vector<uint16_t>> labels;  // by view, [height, width], of the pixel's centre
};

// What the literal perception loss loses on: many small parts that touch and look alike, of which
// every view lacks some masks.
struct CrowdedScene {
  Capture capture;  // masks: of parts, then of objects, in the order of the labels
  CrowdedLevel parts, objects;
  std::vector<uint16_t> object_of_part;
};

// The ray-traced scene of crowded_surfaces.h with disparity as a monocular network gives it: a few
// per cent wrong, smoothly, and in 8 bits. The same bytes on every call.
CrowdedScene MakeCrowdedScene(const CrowdedOptions& options = {});

}  // namespace pepeseg::testing
