#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "core/query/segmenter.h"
#include "pepeseg/v1/segmentation_service.pb.h"

namespace pepeseg {

// One view's part of an answer, encoded.
absl::StatusOr<v1::SegmentResponse::ViewMask> EncodeMask(const std::string& view,
                                                         const SegmentResult& result,
                                                         v1::MaskEncoding encoding);

}  // namespace pepeseg
