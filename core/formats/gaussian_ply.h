#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/scene/gaussians.h"

namespace pepeseg {

// Gaussians as a PLY file in 3DGS's layout, which splat viewers open: binary little-endian, floats
//   x y z nx ny nz f_dc_0..2 f_rest_0.. opacity scale_0..2 rot_0..3
// (x y z as doubles where `origin` is not zero: with it they are in the world of the dataset, which
// the means are not) with normals of 0, f_rest channel by channel (all coefficients of red, then
// green, then blue), opacity as a logit, scales as natural logs, rot as w, x, y, z. Written
// atomically.
absl::Status WriteGaussianPly(const std::filesystem::path& path, const Gaussians& gaussians,
                              const Eigen::Vector3d& origin = Eigen::Vector3d::Zero());
// The same bytes in memory.
std::string EncodeGaussianPly(const Gaussians& gaussians,
                              const Eigen::Vector3d& origin = Eigen::Vector3d::Zero());

// The same bytes in blocks of at most 1 MiB, of some of the Gaussians: so that nobody needs to hold
// all of them. The same block is encoded to the same bytes each time.
class GaussianPlyBlocks {
 public:
  static constexpr int64_t kMaxBlockBytes = int64_t{1} << 20;

  // Of the Gaussians at `indices`, in that order. `gaussians` must outlive it.
  GaussianPlyBlocks(const Gaussians& gaussians, std::vector<uint32_t> indices,
                    const Eigen::Vector3d& origin);

  int64_t num_gaussians() const { return static_cast<int64_t>(indices_.size()); }
  int64_t num_blocks() const;
  int64_t num_bytes() const;  // of all blocks
  // 0 <= block < num_blocks().
  std::string Encode(int64_t block) const;

 private:
  const Gaussians* gaussians_;
  std::vector<uint32_t> indices_;
  Eigen::Vector3d origin_;
  std::string header_;  // the first block
  int64_t row_bytes_ = 0;
  int64_t rows_per_block_ = 0;
};

// Any order of the properties, floats or doubles, others than these passed over; the SH degree (0
// to 3) follows from the number of f_rest. INVALID_ARGUMENT with `name`: a property is missing, the
// file is cut short, a value is not finite, a rotation is zero.
// The means become relative to `origin`.
absl::StatusOr<Gaussians> ReadGaussianPly(const std::filesystem::path& path,
                                          const std::string& name,
                                          const Eigen::Vector3d& origin = Eigen::Vector3d::Zero());

// The same of its header only.
struct GaussianPlyShape {
  int64_t count = 0;
  int sh_degree = 0;
};
absl::StatusOr<GaussianPlyShape> ReadGaussianPlyShape(const std::filesystem::path& path,
                                                      const std::string& name);

}  // namespace pepeseg
