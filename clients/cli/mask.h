#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "pepeseg/v1/segmentation_service.pb.h"

namespace pepeseg::cli {

// [height, width], 0 or 1.
using Mask = std::vector<uint8_t>;

// COCO's compressed run lengths, column-major. DATA_LOSS when the runs do not fill the mask
// exactly.
absl::StatusOr<Mask> DecodeRle(const v1::CocoRle& rle);

// |P and G| / |P or G|, both empty: 1; pixels with a non-zero `ignore` (empty: none) do not count.
double Iou(std::span<const uint8_t> prediction, std::span<const uint8_t> truth,
           std::span<const uint8_t> ignore);

// Pixels of the mask that are not ignored.
int64_t Area(std::span<const uint8_t> mask, std::span<const uint8_t> ignore);

// Squared Euclidean distance of each pixel to the nearest one outside the mask; what lies beyond
// the border of the image is outside. Exact (Felzenszwalb and Huttenlocher 2012).
std::vector<float> SquaredDistanceToOutside(std::span<const uint8_t> mask, int width, int height);

struct Pixel {
  int x = 0, y = 0;
};
// The pixel deepest inside the mask, the first in reading order of several; the mask must not be
// empty.
Pixel DeepestPixel(std::span<const uint8_t> mask, int width, int height);

}  // namespace pepeseg::cli
