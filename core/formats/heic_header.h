#pragma once

#include <cstdint>
#include <span>

#include "absl/status/statusor.h"

namespace pepeseg {

// Returns true if a file begins like a HEIC photograph: an HEVC picture in an ISO base media file
// (ISO/IEC 23008-12), as iPhones write it. AVIF does not count.
bool IsHeic(std::span<const uint8_t> bytes);

struct HeicSize {  // pixels
  uint64_t width = 0;
  uint64_t height = 0;
};

// Returns the size in pixels of the primary picture after the rotation and cropping that the file
// asks for. `bytes` are the first bytes of the file. INVALID_ARGUMENT: they are malformed, or do
// not contain the whole "meta" box.
absl::StatusOr<HeicSize> ReadHeicSize(std::span<const uint8_t> bytes);

// Returns INVALID_ARGUMENT if a box reaches beyond the end of the file, so that the file is cut
// short.
absl::Status CheckHeicIsWhole(std::span<const uint8_t> file);

}  // namespace pepeseg
