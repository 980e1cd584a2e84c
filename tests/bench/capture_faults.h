#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>

#include "tests/bench/capture_pack.h"

namespace pepeseg {

// Faults to put into a capture, for tables of robustness. They affect training views only; held-out
// views stay as they are.
struct CaptureFaults {
  double keep_views = 1;  // share of the training views to keep, evenly spread
  double keep_masks = 1;  // share of the masks to keep, drawn for each view
  double mask_noise =
      0;  // standard deviation, pixels, of a smooth random field that bends the masks
  double pose_noise = 0;   // standard deviation, pixels, of the rotation of views about each axis
  double blur_views = 0;   // share of the training photographs that the camera's motion blurs
  double blur_length = 8;  // length of that motion, pixels
  double mover_views = 0;  // share of the training photographs with something that moves
  bool invert_depth = false;
  bool without_depth = false;
};
void AddFaultFlags(CLI::App& app, CaptureFaults& faults);

// Applies the faults. Each kind of fault is the same for the same capture, whatever other faults
// are requested.
void Spoil(const CaptureFaults& faults, CapturePack& pack);

}  // namespace pepeseg
