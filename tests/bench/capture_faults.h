#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>

#include "tests/bench/capture_pack.h"

namespace pepeseg {

// What is wrong with a capture, for tables of robustness. All of it is done to views that are
// trained on; those that are scored stay as they are.
struct CaptureFaults {
  double keep_views = 1;  // share of the training views, evenly
  double keep_masks = 1;  // share of the masks, drawn for each view alone
  double mask_noise = 0;  // pixels: masks are bent by a smooth random field of this deviation
  double pose_noise = 0;  // pixels: the deviation by which views are turned, about each axis
  bool invert_depth = false;
  bool without_depth = false;
};
void AddFaultFlags(CLI::App& app, CaptureFaults& faults);

// The same faults for the same capture, whatever else is asked for.
void Spoil(const CaptureFaults& faults, CapturePack& pack);

}  // namespace pepeseg
