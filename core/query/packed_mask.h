#pragma once

#include <cstdint>
#include <span>

namespace pepeseg {

// Unpacks what PackMask (kernels/ops/similarity.h) has packed. bits: [NumMaskWords(mask.size())].
// mask: [pixels], becomes 0 or 1.
void UnpackMask(std::span<const uint32_t> bits, std::span<uint8_t> mask);

}  // namespace pepeseg
