#pragma once

#include <cstdint>
#include <vector>

#include "kernels/ops/render.h"

namespace pepeseg {

// Result of the simplest possible renderer, in double and with formulas of its own (nothing of
// kernels/math): every pixel blends every Gaussian in the order of depth.
struct ReferenceImage {
  std::vector<double> color;         // [3, H, W]
  std::vector<double> alpha, depth;  // [H, W]
  // [H, W] 1 where a value is so close to its threshold (1/255, 0.99, 1e-4) that rounding or a
  // small change of the parameters can change the decision.
  std::vector<uint8_t> close_call;
};

struct ReferenceScene {
  int64_t count = 0;
  int sh_degree = 0;
  std::vector<double> planes;  // [NumPlanes(sh_degree), count]
};

struct ReferenceOptions {
  double near_plane = 0.01;
  bool inverse_depth = false;  // blend 1 / z
  double close = 1e-3;         // relative distance to a threshold below which it is a close call
};

ReferenceImage RenderReference(const ReferenceScene& scene, const PinholeView& view,
                               const ReferenceOptions& options);

}  // namespace pepeseg
