#pragma once

#include <cstdint>
#include <vector>

#include "core/query/segmenter.h"

namespace pepeseg::testing {

inline constexpr int kTwoBlobsSize = 96;  // pixels, width and height of each view

// Two blobs in front of three held-out views "a", "b" and "c". At large scales the gate hides the
// dimension in which their features differ: their cosine is (0.25 - p^2) / (0.25 + p^2) with p =
// sigmoid(gate_bias - 20 s). At the default bias it is under -0.5 up to scale 0.4, 0 at 0.5, 0.89
// at 0.6, 0.999 at 0.7; a bias of 2 moves all of this 0.4 down.
Model TwoBlobs(float gate_bias = 10);

// Returns the mask that a click on a blob of the default model selects at a small scale.
std::vector<uint8_t> MaskOfBlob(const Segmenter& segmenter, int view, bool left);

}  // namespace pepeseg::testing
