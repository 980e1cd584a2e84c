#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/scene/capture.h"
#include "core/scene/gaussians.h"
#include "kernels/backend.h"

namespace pepeseg {

// Rows of the blend matrix for some pixels of a view, in backend memory.
struct CapturedRows {
  Buffer<int32_t> first, gaussian;
  Buffer<float> weight, alpha;
};

// Geometry that no longer moves, in backend memory.
class FrozenScene {
 public:
  FrozenScene(Backend& backend, const Gaussians& gaussians, double scene_radius);

  Backend& backend() { return backend_; }
  int64_t num_gaussians() const { return count_; }

  // Depth of each pixel along the optical axis, scene units; 0 where the accumulated alpha is not
  // over a half.
  std::vector<float> Depth(const View& view);

  // pixels: y * width + x.
  CapturedRows Capture(const View& view, std::span<const int32_t> pixels);

 private:
  void Render(const View& view);

  Backend& backend_;
  int64_t count_;
  int sh_degree_;
  float near_plane_;
  Buffer<float> planes_, color_, alpha_, depth_;
  RenderScratch scratch_;
};

}  // namespace pepeseg
