#pragma once

#include <span>
#include <string>

#include "core/scene/capture.h"

namespace pepeseg::testing {

// Returns a .npy file, version 1, with any dict and bytes.
std::string NpyOf(const std::string& dict, const std::string& bytes);
// Returns the dict that NumPy writes for a type such as "<f4" and a shape such as "(2, 3)".
std::string NpyDict(const std::string& type, const std::string& shape);
// Returns the bytes of the values as they are in memory.
template <class T>
std::string BytesOf(std::span<const T> values) {
  return {reinterpret_cast<const char*>(values.data()), values.size_bytes()};
}

// Return the image as a .npy file, and as a .pfm file.
std::string Npy(const FloatImage& image);
std::string Pfm(const FloatImage& image);

}  // namespace pepeseg::testing
