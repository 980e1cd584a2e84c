#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "pepeseg/v1/segmentation_service.pb.h"

namespace pepeseg::client {

// [height, width], row-major, 0 or 1.
using Mask = std::vector<uint8_t>;

// Decodes COCO's compressed run lengths, which are column-major and begin with zeros. DATA_LOSS:
// the runs do not fill the mask exactly, or it has more than 2^30 pixels.
absl::StatusOr<Mask> DecodeRle(const v1::CocoRle& rle);

// Encodes a mask, whose pixels that are not 0 are inside, as DecodeRle reads it.
v1::CocoRle EncodeRle(std::span<const uint8_t> mask, int width, int height);

// Compresses COCO's run lengths, column-major and beginning with zeros, to the string that
// pycocotools writes. Runs that do not fill a mask are not refused.
std::string CompressRuns(std::span<const int64_t> runs);

}  // namespace pepeseg::client
