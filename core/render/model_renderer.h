#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/scene/capture.h"
#include "core/scene/gaussians.h"
#include "core/scene/model.h"
#include "kernels/backend.h"

namespace pepeseg {

// Blend rows of some pixels of a view on the host: pixel i shows gaussian[e] with weight[e] for e
// in [first[i], first[i + 1]).
struct PixelRows {
  std::vector<int32_t> first;     // [pixels + 1]
  std::vector<int32_t> gaussian;  // [entries]
  std::vector<float> weight;      // [entries]
};

// Returns the number of pixels for which memory for renders of a model is kept, from that of its
// largest view: at least a full-HD screen, because free cameras fill a screen.
int64_t MostPixels(int64_t max_view_pixels);

// Renders a model that is in backend memory. Not thread-safe. The backend and the model must
// outlive it. Each call returns RESOURCE_EXHAUSTED when out of memory; a later call may succeed.
// subset: Gaussians of this model to render, [num_gaussians]; the others are left out. Null: all.
class ModelRenderer {
 public:
  ModelRenderer(Backend& backend, const Model& model);

  Backend& backend() const { return backend_; }
  const Model& model() const { return model_; }

  // Returns the view as an RGB image.
  absl::StatusOr<Image> Color(const ModelView& view, const GaussianSet* subset = nullptr);
  // Returns the depth along the optical axis, scene units, [height, width]; 0 where the accumulated
  // alpha is at most a half.
  absl::StatusOr<std::vector<float>> Depth(const ModelView& view,
                                           const GaussianSet* subset = nullptr);
  // Writes the blended features of each pixel to `map`, [height * width, 32]: see
  // RenderFeaturesArgs. Gaussians count by their feature confidence.
  absl::Status Features(const ModelView& view, DeviceSpan<Half> map,
                        const GaussianSet* subset = nullptr);
  // Returns the blend rows of the pixels y * width + x.
  absl::StatusOr<PixelRows> Rows(const ModelView& view, std::span<const int32_t> pixels,
                                 const GaussianSet* subset = nullptr);

  // Frees the memory of a view with more than MostPixels pixels; without such a view does nothing.
  void ReleaseOversized();

 private:
  struct Pass {
    int sh_degree = 0;
    const GaussianSet* subset = nullptr;
    bool with_depth = false;
  };
  absl::Status Render(const ModelView& view, const Pass& pass);
  void HideAllBut(const GaussianSet& subset);
  void ShowAll();
  void Show(const GaussianSet* subset);

  Backend& backend_;
  const Model& model_;
  Buffer<float> planes_, features_, confidence_, color_, alpha_, depth_;
  RenderScratch scratch_;
  const int64_t most_pixels_;
  bool some_hidden_ = false;  // true: opacities in backend memory may differ from the model's
};

}  // namespace pepeseg
