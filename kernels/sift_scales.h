#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "kernels/ops/sift.h"

// The scale space of a photograph that all backends build (kernels/ops/sift.h): its octaves, where
// their levels are in memory, and the taps of its blurs.
//
// Octave -1 has twice the resolution of the photograph, each further octave half of the one before.
// Levels of an octave are kSiftStep apart in scale, from kSiftBaseSigma on. VLFeat makes octave 0
// from octave -1. Here it is made from the photograph by one blur that equals the four blurs of
// octave -1 up to that level, so that octave -1, which is most of the work, can be left out when
// the other octaves have enough features.
namespace pepeseg {

// Levels of one octave, [kSiftLevels, height, stride] floats.
struct SiftOctave {
  int width, height;
  int64_t stride;  // width rounded up to 16
  float step;      // pixels of the photograph for each pixel of the octave
  float* data;     // level 0, see PlaceSiftOctaves

  constexpr int64_t plane() const { return height * stride; }
  constexpr float* Row(int level, int64_t y) const { return data + level * plane() + y * stride; }
};

// Octaves of a photograph of this size, the finest (octave -1) first, without memory. Those with a
// side below 3, which have no features, are left out: none for a photograph of one pixel.
std::vector<SiftOctave> SiftOctaves(int width, int height);

// Number of floats of the levels of octaves. Whole vectors can be loaded from beyond both ends of
// an octave.
int64_t SiftLevelFloats(std::span<const SiftOctave> octaves);
// Gives octaves their memory, of SiftLevelFloats floats.
void PlaceSiftOctaves(float* memory, std::span<SiftOctave> octaves);

// Taps of a blur at distances 0 to radius, which sum to 1 over both sides.
struct SiftTaps {
  int radius;
  float tap[kMaxSiftRadius + 1];  // 0 beyond the radius
};

// Taps from level - 1 to level of an octave, 1 <= level < kSiftLevels.
SiftTaps SiftLevelTaps(int level);
// Taps from the upsampled photograph to level 0 of octave -1.
SiftTaps SiftFinestTaps();
// Taps from the photograph to level 0 of octave 0.
SiftTaps SiftPhotographTaps();

// Returns the finest scale to keep, as an index of `count`, which has the number of points of each
// scale, the finest first. See ExtractSiftArgs.
int FirstSiftScale(const std::vector<int64_t>& count, int64_t max_features);

}  // namespace pepeseg
