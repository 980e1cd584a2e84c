#pragma once

#include <cstdint>
#include <vector>

#include "core/scene/capture.h"
#include "core/scene/mask_set.h"

// A photograph with an EXIF orientation has two pixel frames: "stored", as in the file, and
// "upright", after the orientation was applied (core/scene/photograph.h). Files that belong to a
// photograph are made for either: COLMAP reads the stored pixels, while OpenCV, Polycam and many
// scripts apply the orientation.
namespace pepeseg {

enum class PixelFrame { kStored, kUpright };

// Returns "stored" or "upright".
const char* NameOf(PixelFrame frame);

// Returns the EXIF orientation that undoes `orientation`, which is in [1, 8].
int InverseOrientation(int orientation);

// Rotate and mirror masks or values by an EXIF orientation in [1, 8], as Upright does an image.
// `values` is [height, width].
MaskSet Turned(const MaskSet& masks, int orientation);
FloatImage Turned(const FloatImage& map, int orientation);
std::vector<uint8_t> Turned(const std::vector<uint8_t>& values, int width, int height,
                            int orientation);

}  // namespace pepeseg
