#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "core/scene/capture.h"

namespace pepeseg::testing {

struct SyntheticOptions {
  int num_views = 12;  // on an arc of 90 degrees about the objects
  int width = 96;
  int height = 72;
  int held_out_every = 6;  // from the first; 0: none
  int num_points = 600;    // on the surfaces, coloured
  bool with_masks = true;
  std::optional<DepthPrior::Kind> depth = {};  // with exact priors: 0 at one end, 1 at the other
};

// Labels of the objects on the synthetic table; the table and the backdrop are 0.
inline constexpr int kRedBox = 1;
inline constexpr int kGreenBall = 2;
inline constexpr int kBlueBox = 3;
inline constexpr int kNumObjects = 3;

struct SyntheticScene {
  Capture capture;  // masks: one per object that shows in the view, in the order of the labels
  std::vector<std::vector<uint8_t>> labels;  // by view, [height, width], of the pixel's centre
};

// A ray-traced scene whose truth is known exactly: two boxes and a ball, textured and Lambertian,
// on a table in front of a backdrop. Units: the table is 4 wide. The same bytes on every call.
SyntheticScene MakeSyntheticScene(const SyntheticOptions& options = {});

}  // namespace pepeseg::testing
