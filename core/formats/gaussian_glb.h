#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "core/formats/gaussian_blocks.h"
#include "core/scene/gaussians.h"

namespace pepeseg {

// Greatest number of Gaussians of a GLB of any SH degree: the format holds 4 GiB.
inline constexpr int64_t kMaxGlbGaussians = 17'000'000;

// A subset of Gaussians as a binary glTF 2.0 with the extension KHR_gaussian_splatting (Khronos,
// 2026): a mesh of points with an interleaved row for each Gaussian, kernel "ellipse" and colours
// "srgb_rec709_display". Scales are linear, opacities 0 to 1, rotations x, y, z, w of length 1.
// COLOR_0 has the base colour, linear, and the opacity, for programs that show points only. The
// axes are those of glTF (y_up.h), the positions relative to the model's origin; `translation`, in
// the axes of the dataset, moves the node to the world. At most kMaxGlbGaussians.
class GaussianGlbBlocks final : public GaussianRowBlocks {
 public:
  // See GaussianBlocks.
  GaussianGlbBlocks(const Gaussians& gaussians, std::vector<uint32_t> indices,
                    const Eigen::Vector3d& translation = Eigen::Vector3d::Zero());

 private:
  std::string EncodeRows(int64_t first, int64_t count) const override;
};

}  // namespace pepeseg
