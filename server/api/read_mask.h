#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "core/scene/capture.h"
#include "core/scene/mask_set.h"
#include "pepeseg/v1/prompt.pb.h"
#include "server/api/pixel_frame.h"

// Images of a request that belong to a view or its photograph. INVALID_ARGUMENT names `field`, and
// both sizes where they differ.
namespace pepeseg {

// Width and height of an image that a request holds, as it says; an image that says nothing is 0x0.
struct ImageSize {
  int64_t width = 0, height = 0;

  bool operator==(const ImageSize&) const = default;
};
ImageSize SizeOf(const v1::MaskImage& image);

// A grey PNG of the image's size; its header is checked before anything is decoded.
absl::StatusOr<FloatImage> DecodeGreyOf(const ImageOfView& image, const std::string& png,
                                        const std::string& field);

// A mask of the image's size with at least one pixel.
absl::StatusOr<BinaryMask> ReadMask(const v1::MaskImage& mask, const ImageOfView& image,
                                    const std::string& field);
// A mask that ReadMask has read, in the view. INVALID_ARGUMENT: the view shows nothing of it.
absl::StatusOr<BinaryMask> TakeToView(BinaryMask mask, const ImageOfView& image,
                                      const std::string& field);

// The mask at another size: the nearest pixel.
BinaryMask Resized(const BinaryMask& mask, const ImageSize& from, const ImageSize& to);

}  // namespace pepeseg
