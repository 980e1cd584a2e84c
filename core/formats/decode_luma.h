#pragma once

#include <cstdint>
#include <filesystem>
#include <span>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "core/scene/capture.h"

// The grey pixels of photographs in which features are found. They are those that COLMAP 3.8 reads
// by FreeImage 3.18, because the decoder of a JPEG moves a quarter of the features
// (tests/bench/results/features_sift.md).
namespace pepeseg {

// Decodes a JPEG, PNG or WebP photograph to luma, one channel. JPEGs are decoded as FreeImage does
// by default: by the fast, less accurate DCT, and with chroma that is repeated and not
// interpolated. Others are decoded by DecodePhoto. Ignores the EXIF orientation and alpha. Errors
// as DecodePhoto.
absl::StatusOr<Image> DecodeLuma(const std::filesystem::path& path, absl::string_view name);
absl::StatusOr<Image> DecodeLuma(std::span<const uint8_t> bytes, absl::string_view name);

// Returns the luma of an RGB image by the weights of Rec. 709, rounded. Returns a grey image as it
// is.
Image LumaOf(Image image);

}  // namespace pepeseg
