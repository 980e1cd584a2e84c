#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/scene/gaussians.h"

namespace pepeseg {

// Gaussians as a PLY file in 3DGS's layout, which splat viewers open: binary little-endian, floats
//   x y z nx ny nz f_dc_0..2 f_rest_0.. opacity scale_0..2 rot_0..3
// with normals of 0, f_rest channel by channel (all coefficients of red, then green, then blue),
// opacity as a logit, scales as natural logs, rot as w, x, y, z. Written atomically.
absl::Status WriteGaussianPly(const std::filesystem::path& path, const Gaussians& gaussians);
// The same bytes in memory.
std::string EncodeGaussianPly(const Gaussians& gaussians);

// Any order of the properties, floats or doubles, others than these passed over; the SH degree (0
// to 3) follows from the number of f_rest. INVALID_ARGUMENT with `name`: a property is missing, the
// file is cut short, a value is not finite, a rotation is zero.
absl::StatusOr<Gaussians> ReadGaussianPly(const std::filesystem::path& path,
                                          const std::string& name);

// The same of its header only.
struct GaussianPlyShape {
  int64_t count = 0;
  int sh_degree = 0;
};
absl::StatusOr<GaussianPlyShape> ReadGaussianPlyShape(const std::filesystem::path& path,
                                                      const std::string& name);

}  // namespace pepeseg
