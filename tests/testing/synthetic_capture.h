#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "core/scene/capture.h"

namespace pepeseg::testing {

struct SyntheticOptions {
  int num_views = 12;  // on an arc of 90 degrees around the objects
  int width = 96;
  int height = 72;
  int held_out_every = 6;  // holds out the first view and every n-th after it; 0: none
  int num_points = 600;    // coloured points on the surfaces
  bool with_masks = true;
  // Kind of the exact depth priors, whose values span [0, 1] in each view; none: no priors.
  std::optional<DepthPrior::Kind> depth = {};
};

// Labels of the objects on the synthetic table; the table and the backdrop are 0.
inline constexpr int kRedBox = 1;
inline constexpr int kGreenBall = 2;
inline constexpr int kBlueBox = 3;
inline constexpr int kNumObjects = 3;

struct SyntheticScene {
  Capture capture;  // with a mask of each object visible in a view, in the order of the labels
  std::vector<std::vector<uint8_t>> labels;  // by view, [height, width], at the pixels' centres
};

// Makes a ray-traced scene whose ground truth is known exactly: two boxes and a ball, textured and
// Lambertian, on a table in front of a backdrop. The table is 4 units wide. Returns the same bytes
// on every call.
SyntheticScene MakeSyntheticScene(const SyntheticOptions& options = {});

// Returns the capture of the default scene, which a program makes once.
const Capture& SyntheticCapture();

}  // namespace pepeseg::testing
