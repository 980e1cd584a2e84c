#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/formats/gaussian_blocks.h"
#include "core/scene/gaussians.h"

namespace pepeseg {

// Which coordinates x y z of a file are. Where the origin is zero, both are the same.
enum class PlyCoordinates {
  kWorld,  // of the dataset's world, as doubles, which many viewers read wrongly or not at all
  kLocal,  // relative to the origin, as floats; the comment "pepeseg_origin X Y Z" has the origin
};

// Writes Gaussians as a PLY file in the layout of 3DGS, which splat viewers open. It is binary
// little-endian, and a vertex has the floats
//   x y z nx ny nz f_dc_0..2 f_rest_0.. opacity scale_0..2 rot_0..3
// Normals are 0; f_rest holds all coefficients of red, then green, then blue; opacity is a logit;
// scales are natural logarithms; rot is w, x, y, z. `origin` is added to x y z, so that they are in
// the world of the dataset (camera.h); they are doubles if it is not zero. The file is written
// atomically.
absl::Status WriteGaussianPly(const std::filesystem::path& path, const Gaussians& gaussians,
                              const Eigen::Vector3d& origin = Eigen::Vector3d::Zero());
// Returns the bytes that WriteGaussianPly would write.
std::string EncodeGaussianPly(const Gaussians& gaussians,
                              const Eigen::Vector3d& origin = Eigen::Vector3d::Zero());

// For each level of a decomposition the id of the segment of each Gaussian, 0 in none.
using SegmentIds = std::vector<std::vector<int32_t>>;

// A subset of Gaussians as such a file. It has a further int property for each level of
// `segment_ids`: segment_0, segment_1, ...
class GaussianPlyBlocks final : public GaussianRowBlocks {
 public:
  // See GaussianBlocks.
  GaussianPlyBlocks(const Gaussians& gaussians, std::vector<uint32_t> indices,
                    const Eigen::Vector3d& origin,
                    PlyCoordinates coordinates = PlyCoordinates::kWorld,
                    SegmentIds segment_ids = {});

 private:
  std::string EncodeRows(int64_t first, int64_t count) const override;

  const Eigen::Vector3d added_;  // to x y z
  const SegmentIds segment_ids_;
};

// Reads Gaussians from such a file. The properties may have any order and number type, and other
// properties are skipped. The SH degree, 0 to 3, follows from the number of f_rest properties. The
// means become relative to `origin`; a comment "pepeseg_origin X Y Z" is added to them.
// INVALID_ARGUMENT, naming `name`: as OpenPly, the file is text, a property is missing, a value is
// not finite, or a rotation is zero.
absl::StatusOr<Gaussians> ReadGaussianPly(const std::filesystem::path& path,
                                          const std::string& name,
                                          const Eigen::Vector3d& origin = Eigen::Vector3d::Zero());

// What the header of such a file declares.
struct GaussianPlyShape {
  int64_t count = 0;
  int sh_degree = 0;
  bool has_doubles = false;  // x y z are doubles
};
// Reads only the header. Errors as ReadGaussianPly, except those of values.
absl::StatusOr<GaussianPlyShape> ReadGaussianPlyShape(const std::filesystem::path& path,
                                                      const std::string& name);

}  // namespace pepeseg
