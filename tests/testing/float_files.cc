#include "tests/testing/float_files.h"

namespace pepeseg::testing {

std::string NpyOf(const std::string& dict, const std::string& bytes) {
  std::string file("\x93NUMPY\x01\x00", 8);
  file += static_cast<char>(dict.size() & 0xff);
  file += static_cast<char>(dict.size() >> 8);
  return file + dict + bytes;
}

std::string NpyDict(const std::string& type, const std::string& shape) {
  return "{'descr': '" + type + "', 'fortran_order': False, 'shape': " + shape + ", }     \n";
}

std::string Npy(const FloatImage& image) {
  const std::string shape =
      "(" + std::to_string(image.height) + ", " + std::to_string(image.width) + ")";
  return NpyOf(NpyDict("<f4", shape), BytesOf<float>(image.values));
}

std::string Pfm(const FloatImage& image) {
  std::string file =
      "Pf\n" + std::to_string(image.width) + " " + std::to_string(image.height) + "\n-1.0\n";
  for (int y = image.height - 1; y >= 0; --y) {
    const auto width = static_cast<size_t>(image.width);
    file += BytesOf<float>(std::span(image.values).subspan(y * width, width));
  }
  return file;
}

}  // namespace pepeseg::testing
