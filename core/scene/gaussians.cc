#include "core/scene/gaussians.h"

#include <cassert>

namespace pepeseg {

Gaussians Gaussians::Zero(int64_t count, int sh_degree) {
  assert(count >= 0 && sh_degree >= 0 && sh_degree <= kMaxShDegree);
  Gaussians out;
  out.count = count;
  out.sh_degree = sh_degree;
  out.planes.assign(static_cast<size_t>(NumPlanes(sh_degree) * count), 0.0f);
  return out;
}

Gaussians Gaussians::Select(std::span<const int64_t> rows) const {
  Gaussians out = Zero(static_cast<int64_t>(rows.size()), sh_degree);
  for (int k = 0; k < NumPlanes(sh_degree); ++k) {
    const std::span<const float> from = Plane(k);
    const std::span<float> to = out.Plane(k);
    for (size_t i = 0; i < rows.size(); ++i) to[i] = from[static_cast<size_t>(rows[i])];
  }
  return out;
}

}  // namespace pepeseg
