#include "core/scene/gaussians.h"

#include <cassert>

namespace pepeseg {

Gaussians Gaussians::Zero(int64_t count, int sh_degree) {
  assert(count >= 0 && sh_degree >= 0 && sh_degree <= kMaxShDegree);
  Gaussians result{.count = count, .sh_degree = sh_degree, .planes = {}};
  result.planes.assign(static_cast<size_t>(count) * NumPlanes(sh_degree), 0.0f);
  return result;
}

Gaussians Gaussians::Select(std::span<const int64_t> rows) const {
  // Plane by plane, so that writes are sequential.
  Gaussians result = Zero(static_cast<int64_t>(rows.size()), sh_degree);
  for (int k = 0; k < NumPlanes(sh_degree); ++k) {
    const std::span<const float> from = Plane(k);
    const std::span<float> to = result.Plane(k);
    for (size_t i = 0; i < rows.size(); ++i) {
      assert(rows[i] >= 0 && rows[i] < count);
      to[i] = from[rows[i]];
    }
  }
  return result;
}

}  // namespace pepeseg
