#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/scene/capture.h"
#include "core/scene/gaussians.h"
#include "kernels/backend.h"

namespace pepeseg {

// Blend rows of some pixels of a view in backend memory: pixel i shows gaussian[e] with weight[e]
// for e in [first[i], first[i + 1]).
struct CapturedRows {
  Buffer<int32_t> first;     // [pixels + 1]
  Buffer<int32_t> gaussian;  // [entries]
  Buffer<float> weight;      // [entries]
  Buffer<float> alpha;       // [pixels] accumulated alpha
};

// Gaussians whose geometry is fixed, in backend memory, for stage two (METHOD.md section 3). To be
// used by one thread at a time. The backend must outlive it and reports errors: see Backend::error.
class FrozenScene {
 public:
  // scene_radius: scene units, see SceneRadius; it decides the near plane.
  FrozenScene(Backend& backend, const Gaussians& gaussians, double scene_radius);

  Backend& backend() { return backend_; }
  int64_t num_gaussians() const { return count_; }

  // Returns the depth of each pixel along the optical axis, scene units, [height, width]; 0 where
  // the accumulated alpha is at most a half.
  std::vector<float> Depth(const View& view);

  // Returns the blend rows of the pixels y * width + x. Waits for the backend.
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

// Blend rows on the host, laid out as CapturedRows.
struct HostRows {
  explicit HostRows(const CapturedRows& rows);
  size_t num_rows() const { return first.empty() ? 0 : first.size() - 1; }

  std::vector<int32_t> first, gaussian;
  std::vector<float> weight;
};

// Returns GridPixels of the view's camera without the pixels that the view ignores.
std::vector<int32_t> KnownGridPixels(const View& view, double max_cells);

}  // namespace pepeseg
