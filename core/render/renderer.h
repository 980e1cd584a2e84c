#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/scene/camera.h"
#include "core/scene/capture.h"
#include "core/scene/gaussians.h"
#include "core/scene/model.h"
#include "kernels/backend.h"

namespace pepeseg {

// What a renderer reads of a view.
struct Viewpoint {
  // Implicit, so that views of a capture and of a model are rendered alike.
  Viewpoint(const View& view)  // NOLINT(google-explicit-constructor)
      : camera(view.camera), cam_from_world(view.cam_from_world) {}
  Viewpoint(const ModelView& view)  // NOLINT(google-explicit-constructor)
      : camera(view.camera), cam_from_world(view.cam_from_world) {}

  Camera camera;
  Pose cam_from_world;
};

// Blend rows of some pixels of a view in backend memory: pixel i shows gaussian[e] with weight[e]
// for e in [first[i], first[i + 1]).
struct CapturedRows {
  Buffer<int32_t> first;     // [pixels + 1]
  Buffer<int32_t> gaussian;  // [entries]
  Buffer<float> weight;      // [entries]
  Buffer<float> alpha;       // [pixels] accumulated alpha
};
// The same on the host.
struct PixelRows {
  size_t num_rows() const { return first.empty() ? 0 : first.size() - 1; }

  std::vector<int32_t> first;     // [pixels + 1]
  std::vector<int32_t> gaussian;  // [entries]
  std::vector<float> weight;      // [entries]
};
// Copies rows to the host. Waits for the backend. Returns no rows if it ran out of memory.
PixelRows ToHost(const CapturedRows& rows);

// Returns the segment that each row shows: the id with the largest sum of blend weights, or the
// smallest of several such ids. 0 where the weights sum to less than a half or where Gaussians in
// no segment have the largest sum. ids: the segment of each Gaussian, [num_gaussians], 0: none.
std::vector<int32_t> IdsOfRows(const PixelRows& rows, std::span<const int32_t> ids);

// Returns the number of pixels for which memory for renders of a model is kept, from that of its
// largest view: at least a full-HD screen, because free cameras fill a screen.
int64_t MostPixels(int64_t max_view_pixels);

// Returns the scratch of a render of one view with `num_gaussians` visible Gaussians. It assumes an
// overlap above what the measured scenes have (step_cpu.md); large, faint Gaussians may need more.
ScratchSize TypicalScratch(int64_t num_gaussians, int64_t num_pixels);

// Rendered depth on the host, [height, width] each.
struct WeightedDepth {
  std::vector<float> alpha;  // accumulated alpha
  std::vector<float> depth;  // sum of weight * z, scene units

  // Divides the depths by alpha: they become those that Renderer::Depth returns.
  void Normalise();
};

// Renders Gaussians that do not change, from copies in backend memory. For one thread at a time.
// The backend must outlive it and reports errors (Backend::error, TakeStatus): results of a call
// during which the backend failed, or had failed before, are zeros or empty.
//
// subset: Gaussians to render, [num_gaussians]; the others are left out. Null: all.
class Renderer {
 public:
  // Renders no features and no subsets. scene_radius: scene units, see SceneRadius; it decides the
  // near plane.
  Renderer(Backend& backend, const Gaussians& gaussians, double scene_radius);
  // Renders the Gaussians of another renderer of captures, which must outlive it, on a twin of that
  // one's backend (Backend::MakeTwin), which must have been synchronised. Both may be used at once.
  Renderer(Backend& twin, const Renderer& other);
  // Renders everything. The model must outlive the renderer.
  Renderer(Backend& backend, const Model& model);

  Backend& backend() const { return backend_; }
  int64_t num_gaussians() const { return count_; }

  // Returns the colours in backend memory, [3, height, width], in [0, 1] before clamping, valid
  // until the next call.
  DeviceSpan<const float> ColorPlanes(const Viewpoint& view, const GaussianSet* subset = nullptr);
  // Returns the same on the host. Waits for the backend.
  std::vector<float> HostColorPlanes(const Viewpoint& view, const GaussianSet* subset = nullptr);
  // Returns the view as an RGB image.
  Image Color(const Viewpoint& view, const GaussianSet* subset = nullptr);
  // Returns the depth along the optical axis, scene units, [height, width]; 0 where the accumulated
  // alpha is at most a half.
  std::vector<float> Depth(const Viewpoint& view, const GaussianSet* subset = nullptr);
  // Does the same but for the division, which another thread can do while the next view is
  // rendered, and uses the memory of `depth` again.
  void Depth(const Viewpoint& view, WeightedDepth& depth, const GaussianSet* subset = nullptr);
  // Writes the blended features of each pixel to `map`, [height * width, 32]: see
  // RenderFeaturesArgs. Gaussians count by their feature confidence. Also writes the colours of
  // ColorPlanes to `color`, [3, height, width], unless it is empty.
  void Features(const Viewpoint& view, DeviceSpan<Half> map, DeviceSpan<float> color,
                const GaussianSet* subset = nullptr);
  // Returns the blend rows of the pixels y * width + x. Waits for the backend.
  CapturedRows Rows(const Viewpoint& view, std::span<const int32_t> pixels,
                    const GaussianSet* subset = nullptr);
  // Returns the segment that each pixel shows, [height, width]: see IdsOfRows.
  std::vector<int32_t> Ids(const Viewpoint& view, std::span<const int32_t> ids,
                           const GaussianSet* subset = nullptr);
  // Renders the view for backward and finds the gradients of its splats, for AddWeights, from those
  // of the colours: color_grad, [3, height, width].
  void RenderBackward(const Viewpoint& view, DeviceSpan<const float> color_grad);
  // Adds the gradients of the splats' colours after the latest RenderBackward to `sums`,
  // [num_planes, num_gaussians]: see AddWeightsArgs.
  void AddWeights(DeviceSpan<float> sums, int num_planes);

  // Frees the memory of a view with more than MostPixels pixels; without such a view does nothing.
  void ReleaseOversized();

 private:
  struct Pass {
    int sh_degree = 0;
    const GaussianSet* subset = nullptr;
    bool with_depth = false;
    bool for_backward = false;
  };
  void Render(const Viewpoint& view, const Pass& pass);
  CapturedRows Capture(std::span<const int32_t> pixels);
  void Show(const GaussianSet* subset);

  Backend& backend_;
  const int64_t count_;
  const int sh_degree_;
  const float near_plane_;
  const int64_t most_pixels_;
  std::span<const float> logits_;  // opacities on the host, [num_gaussians]; empty without a model
  Buffer<float> planes_;
  const float* shown_planes_;  // those of planes_ or of the other renderer
  Buffer<float> features_, confidence_, color_, alpha_, depth_;
  RenderScratch scratch_;
  bool some_hidden_ = false;  // true: opacities in backend memory may differ from the model's
};

}  // namespace pepeseg
