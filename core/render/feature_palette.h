#pragma once

#include <array>
#include <span>

#include "core/scene/camera.h"
#include "core/scene/capture.h"
#include "core/scene/model.h"
#include "kernels/buffer.h"
#include "kernels/ops/render.h"

namespace pepeseg {

// Map from features at one scale to colours. Red, green and blue are the first three principal
// components of the model's gated unit features, each stretched so that its 2nd to 98th percentile
// over the Gaussians fills [0, 1]. The same for all views, so that an object has one colour.
struct FeaturePalette {
  std::array<float, kFeatureSize> psi{};                  // gate at the scale
  std::array<std::array<float, kFeatureSize>, 3> axis{};  // unit vectors, a channel each
  std::array<float, 3> low{}, high{};                     // components that become 0 and 1
};

// Computes the palette of a field at a scale in [0, 1]. A field without features gets axes of 0.
FeaturePalette MakeFeaturePalette(const FeatureField& field, double scale);

// Returns an RGB image of a feature map, [height * width, 32] as rendered. Pixels whose feature is
// shorter than kMinPixelNorm are black.
Image PaintFeatures(const FeaturePalette& palette, std::span<const Half> map, const Camera& camera);

}  // namespace pepeseg
