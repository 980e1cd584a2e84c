#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/scene/capture.h"
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

// A model in backend memory that is rendered. Not thread safe. The backend and the model must
// outlive it. Every call: RESOURCE_EXHAUSTED when there is no memory.
class ModelRenderer {
 public:
  ModelRenderer(Backend& backend, const Model& model);

  Backend& backend() const { return backend_; }
  const Model& model() const { return model_; }

  absl::StatusOr<Image> Color(const ModelView& view);
  // sum of weight * feature of each pixel: [height * width, 32].
  absl::Status Features(const ModelView& view, DeviceSpan<Half> map);
  // pixels: y * width + x.
  absl::StatusOr<PixelRows> Rows(const ModelView& view, std::span<const int32_t> pixels);

 private:
  absl::Status Render(const ModelView& view, int sh_degree);

  Backend& backend_;
  const Model& model_;
  Buffer<float> planes_, features_, color_;
  RenderScratch scratch_;
};

}  // namespace pepeseg
