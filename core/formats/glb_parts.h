#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

// Parts that all binary glTF 2.0 files of this project have in common.

namespace pepeseg {

// Numbers of glTF 2.0.
inline constexpr int kGltfFloat = 5126, kGltfUnsignedByte = 5121, kGltfUnsignedShort = 5123,
                     kGltfUnsignedInt = 5125, kGltfArrayBuffer = 34962,
                     kGltfElementArrayBuffer = 34963;

// Returns everything of a GLB in front of `num_bytes` of its buffer, a multiple of 4. `json`: its
// description.
std::string GlbHeader(std::string json, size_t num_bytes);

// Inverts the transfer function of sRGB (IEC 61966-2-1). Clamps to [0, 1].
float LinearOfSrgb(float srgb);

}  // namespace pepeseg
