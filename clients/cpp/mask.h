#pragma once

#include <cstdint>
#include <vector>

#include "absl/status/statusor.h"
#include "pepeseg/v1/segmentation_service.pb.h"

namespace pepeseg::client {

// [height, width], 0 or 1.
using Mask = std::vector<uint8_t>;

// COCO's compressed run lengths, column-major. DATA_LOSS when the runs do not fill the mask
// exactly.
absl::StatusOr<Mask> DecodeRle(const v1::CocoRle& rle);

}  // namespace pepeseg::client
