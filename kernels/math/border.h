#pragma once

#include "kernels/math/hd.h"

// The rule by which a pixel at the border of a mask is decided again (METHOD.md section 4,
// "Borders"). Features are gated, colours are in [0, 1].

namespace pepeseg {

// Radius of the window in which the two sides of a border are described, pixels.
inline constexpr int kBorderRadius = 2;
// Greatest distance of the similarity from the threshold, cosine, with which a pixel may move.
inline constexpr float kBorderUncertain = 0.1f;

// One channel of the feature or of the colour, over the pixels of one side in the window.
struct SideSums {
  float sum = 0, squares = 0;

  PEPESEG_HD void Add(float value) {
    sum += value;
    squares += value * value;
  }
};

// How a pixel compares with the two sides, summed over channels.
struct SideComparison {
  float nearer = 0;    // squared distance to the mean outside minus that to the mean inside
  float variance = 0;  // of both sides

  PEPESEG_HD void Add(SideComparison other) {
    nearer += other.nearer;
    variance += other.variance;
  }
};

// Compares one channel of a pixel with sides of one pixel or more each.
PEPESEG_HD SideComparison CompareSides(float value, SideSums inside, int num_inside,
                                       SideSums outside, int num_outside) {
  const float in_share = 1.0f / static_cast<float>(num_inside);
  const float out_share = 1.0f / static_cast<float>(num_outside);
  const float in = inside.sum * in_share, out = outside.sum * out_share;
  const float to_in = value - in, to_out = value - out;
  return {to_out * to_out - to_in * to_in, Max(0.0f, inside.squares * in_share - in * in) +
                                               Max(0.0f, outside.squares * out_share - out * out)};
}

// Returns whether a pixel belongs inside, from the comparisons of its feature and of its colour.
PEPESEG_HD bool BelongsInside(SideComparison feature, SideComparison color, bool was_inside) {
  // Smaller differences of features and colours, squared, are noise.
  constexpr float kFeatureNoise = 0.01f, kColorNoise = 0.001f;
  // Weight of the evidence of colour. An object may have many colours, but hardly two features.
  constexpr float kColorWeight = 0.3f;
  // Least evidence that moves a pixel to the other side.
  constexpr float kClear = 1;
  const float evidence = feature.nearer / (feature.variance + kFeatureNoise) +
                         kColorWeight * color.nearer / (color.variance + kColorNoise);
  return evidence + (was_inside ? kClear : -kClear) > 0;
}

}  // namespace pepeseg
