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

// Rows of the blend matrix for some pixels of a view: pixel i shows gaussian[e] with weight[e] for
// e in [first[i], first[i + 1]).
struct PixelRows {
  std::vector<int32_t> first;  // [pixels + 1]
  std::vector<int32_t> gaussian;
  std::vector<float> weight;
};

// Memory for renders of a model is set aside for so many pixels, given those of its largest view:
// at least for those of a full-HD screen, which free cameras fill.
int64_t MostPixels(int64_t max_view_pixels);

// A model in backend memory that is rendered. Not thread safe. The backend and the model must
// outlive it. Every call: RESOURCE_EXHAUSTED when there is no memory; the next one may have it. A
// subset, where there is one, is of this model's Gaussians; the others are as if they did not
// exist.
class ModelRenderer {
 public:
  ModelRenderer(Backend& backend, const Model& model);

  Backend& backend() const { return backend_; }
  const Model& model() const { return model_; }

  absl::StatusOr<Image> Color(const ModelView& view, const GaussianSet* subset = nullptr);
  // Along the optical axis, in scene units: [height, width]; 0 where the accumulated alpha is not
  // over a half.
  absl::StatusOr<std::vector<float>> Depth(const ModelView& view,
                                           const GaussianSet* subset = nullptr);
  // What is blended of the features into each pixel, [height * width, 32]: see RenderFeaturesArgs.
  absl::Status Features(const ModelView& view, DeviceSpan<Half> map,
                        const GaussianSet* subset = nullptr);
  // pixels: y * width + x.
  absl::StatusOr<PixelRows> Rows(const ModelView& view, std::span<const int32_t> pixels,
                                 const GaussianSet* subset = nullptr);

  // Gives back what a view of more than MostPixels took: it is not kept for the next one.
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
  void Show(const GaussianSet* subset);  // null: all

  Backend& backend_;
  const Model& model_;
  Buffer<float> planes_, features_, confidence_, color_, alpha_, depth_;
  RenderScratch scratch_;
  const int64_t most_pixels_;
  bool some_hidden_ = false;  // of the opacities on the backend
};

}  // namespace pepeseg
