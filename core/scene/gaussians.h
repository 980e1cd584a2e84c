#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "kernels/gaussian_planes.h"

namespace pepeseg {

// Gaussians on the host, in the planes of kernels/gaussian_planes.h with stride == count.
struct Gaussians {
  int64_t count = 0;
  int sh_degree = 0;
  std::vector<float> planes;  // [NumPlanes(sh_degree), count]

  static Gaussians Zero(int64_t count, int sh_degree);
  std::span<float> Plane(int k) { return {planes.data() + k * count, static_cast<size_t>(count)}; }
  std::span<const float> Plane(int k) const {
    return {planes.data() + k * count, static_cast<size_t>(count)};
  }
  // Keeps the rows named, in the order named.
  Gaussians Select(std::span<const int64_t> rows) const;
};

}  // namespace pepeseg
