#pragma once

#include <array>
#include <span>

#include "core/scene/camera.h"
#include "core/scene/capture.h"
#include "core/scene/model.h"
#include "kernels/buffer.h"
#include "kernels/ops/render.h"

namespace pepeseg {

// How features at one scale become colours: the first three principal components of the whole
// model's gated unit features, each stretched so that all but the lowest and highest 2 % of the
// Gaussians fill [0, 1]. It does not depend on a view, so a thing has one colour in all of them.
struct FeaturePalette {
  std::array<float, kFeatureSize> psi{};                  // the gate at the scale
  std::array<std::array<float, kFeatureSize>, 3> axis{};  // unit vectors
  std::array<float, 3> low{}, high{};                     // along the axes: 0 and 1 of a channel
};
FeaturePalette MakeFeaturePalette(const FeatureField& field, double scale);

// A feature map, [height * width, 32] as rendered, in these colours; black where nothing is.
Image PaintFeatures(const FeaturePalette& palette, std::span<const Half> map, const Camera& camera);

}  // namespace pepeseg
