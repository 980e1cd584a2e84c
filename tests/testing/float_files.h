#pragma once

#include <span>
#include <string>

#include "core/scene/capture.h"

namespace pepeseg::testing {

// A .npy file, version 1, of any dict and bytes.
std::string NpyOf(const std::string& dict, const std::string& bytes);
// The dict of NumPy itself for a type as "<f4" and a shape as "(2, 3)".
std::string NpyDict(const std::string& type, const std::string& shape);
// The values' bytes as they are in memory.
template <class T>
std::string BytesOf(std::span<const T> values) {
  return {reinterpret_cast<const char*>(values.data()), values.size_bytes()};
}

std::string Npy(const FloatImage& image);
std::string Pfm(const FloatImage& image);

}  // namespace pepeseg::testing
