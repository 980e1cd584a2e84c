#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

namespace pepeseg {

// A picture with values that are known in some pixels and are to be continued into others.
struct HolePicture {
  int width = 0, height = 0;
  std::vector<uint8_t> known;  // [height, width] 0 or 1
  std::vector<uint8_t> hole;   // [height, width] 0 or 1: to be filled; not known
  Eigen::MatrixXd values;      // [height * width, channels]; read where known, set in the hole

  size_t num_pixels() const { return known.size(); }
};

// Takes those connected parts out of the hole whose border, the pixels next to them, is known by
// less than `min_known` of it: nothing around them says what they show. Returns how many pixels are
// left.
int64_t KeepEnclosed(double min_known, HolePicture& picture);

// Sets the values in the hole to the smoothest ones that agree with the known pixels around it:
// each is the mean of its neighbours (Laplace's equation). A plane whose values are linear in the
// picture, such as the inverse depth of a flat surface, is continued exactly. Neighbours that are
// neither known nor in the hole do not count. Each connected part of the hole must touch a known
// pixel.
void FillSmoothly(HolePicture& picture);

// Returns the pixels within `radius` of a pixel that is set, as a square: [height, width].
std::vector<uint8_t> Dilated(std::span<const uint8_t> mask, int width, int height, int radius);

}  // namespace pepeseg
