#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/formats/gaussian_blocks.h"
#include "core/scene/gaussians.h"
#include "kernels/thread_pool.h"

namespace pepeseg {

// Greatest number of Gaussians of an SOG.
inline constexpr int64_t kMaxSogGaussians = 20'000'000;

// Makes an SOG, version 2, in one file
// (https://developer.playcanvas.com/user-manual/gaussian-splatting/formats/sog): a zip of lossless
// WebP images with a pixel for each Gaussian, in Morton order. A coordinate has 16 bits between the
// least and the greatest one, after sign(x) log(1 + |x|); a rotation's three smaller components and
// the opacity have 8 bits each. Logs of scales, and colours, are each one of 256 values, and the SH
// coefficients of degree 1 to 3 together one of up to 65,536 vectors, whose coefficients are each
// one of 256 values. The axes are those of the world, as in a PLY, and positions are relative to
// the model's origin.
//
// Where the description and the programs that read the format disagree, it is written as these read
// it: the axes, the order w, x, y, z of a rotation's components, and that scales are logs.
//
// The file is in memory as a whole. It is the same for any number of threads. A million Gaussians
// of degree 3 take about 10 s of one core. `check` is called now and then; its error ends the work.
absl::StatusOr<std::unique_ptr<const GaussianBlocks>> MakeGaussianSog(
    const Gaussians& gaussians, std::vector<uint32_t> indices, ThreadPool& pool,
    absl::FunctionRef<absl::Status()> check);

// Returns the memory that MakeGaussianSog takes at most for `count` Gaussians, the file included.
int64_t BytesOfSog(int64_t count, int sh_degree);

}  // namespace pepeseg
