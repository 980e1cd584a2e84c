#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "core/io/float_image.h"
#include "core/scene/mask_set.h"
#include "core/scene/model.h"
#include "pepeseg/v1/prompt.pb.h"

// Images of a request that belong to a view. INVALID_ARGUMENT names `field`.
namespace pepeseg {

// A grey PNG of the view's size; its header tells before anything is decoded.
absl::StatusOr<FloatImage> DecodeGreyOf(const ModelView& view, const std::string& png,
                                        const std::string& field);

// A mask of the view's size with at least one pixel.
absl::StatusOr<BinaryMask> ReadMask(const v1::MaskImage& image, const ModelView& view,
                                    const std::string& field);

}  // namespace pepeseg
