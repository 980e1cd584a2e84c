#pragma once

#include <cstdint>
#include <span>

#include "absl/status/statusor.h"

namespace pepeseg {

// Whether a file begins as a HEIC photograph: HEVC pictures in an ISO base media file (ISO/IEC
// 23008-12), as iPhones write them. AVIF is not one.
bool IsHeic(std::span<const uint8_t> bytes);

struct HeicSize {
  uint64_t width = 0;
  uint64_t height = 0;
};

// The size of the primary picture as it is shown, after its own rotation and cropping. `bytes`: the
// first bytes of the file, with all of its "meta" box. INVALID_ARGUMENT: malformed, or the box is
// not among the bytes.
absl::StatusOr<HeicSize> ReadHeicSize(std::span<const uint8_t> bytes);

// INVALID_ARGUMENT: a box reaches beyond the end of the file.
absl::Status CheckHeicIsWhole(std::span<const uint8_t> file);

}  // namespace pepeseg
