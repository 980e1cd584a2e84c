#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/annotations/mask_polygons.h"

namespace pepeseg {

// Returns COCO's compressed run lengths of the mask of each id, from 1 to `count`, in an image of
// ids [height, width]; other ids are in no mask. Takes the time of one mask, not of `count`.
std::vector<std::string> CountsOfIds(std::span<const int32_t> ids, size_t count,
                                     const RasterSize& size);

}  // namespace pepeseg
