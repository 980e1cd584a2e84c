#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "core/formats/image_header.h"
#include "core/scene/capture.h"

namespace pepeseg {

// How libjpeg decodes: by the accurate DCT and with interpolated chroma, or by the fast DCT and
// with repeated chroma.
enum class JpegDecoding { kAccurate, kFast };

// Called for each scanline in order, with its samples of 1 (grey), 3 (RGB) or 4 channels (inverted
// CMYK, as Adobe's programs write it).
using JpegRowFn = absl::FunctionRef<void(std::span<const uint8_t> scanline, int channels)>;

// Decodes a JPEG whose header ReadImageHeader has returned. INVALID_ARGUMENT, naming `name`: it
// does not decode, or not to the header's size.
absl::Status DecodeJpeg(std::span<const uint8_t> bytes, const ImageHeader& header,
                        absl::string_view name, JpegDecoding how, JpegRowFn take);

// Encodes a valid image of 1 or 3 channels as a baseline JPEG with chroma of half the size.
absl::StatusOr<std::string> JpegBytes(const Image& image, int quality);

}  // namespace pepeseg
