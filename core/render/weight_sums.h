#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/render/renderer.h"
#include "kernels/buffer.h"

// Sums of blend weights by Gaussian over the pixels of a view, from a backward pass
// (AddWeightsArgs): it takes less time than blend rows, which the host would have to add up.

namespace pepeseg {

// Largest number of pixels of a WeightView, so that time and memory do not grow with the
// photographs.
inline constexpr int64_t kMaxWeightPixels = 262'144;

// A view with its whole field of view, shrunk to at most kMaxWeightPixels pixels. Pixels are
// indices y * width + x.
class WeightView {
 public:
  explicit WeightView(const Viewpoint& view);

  // The view with the shrunk camera.
  const Viewpoint& viewpoint() const { return shrunk_; }
  int32_t num_pixels() const { return shrunk_.camera.width * shrunk_.camera.height; }
  // Returns the pixel of the full view at the centre of each pixel of the shrunk view.
  std::vector<int32_t> FullPixels() const;
  // Returns the pixel of the shrunk view that contains the centre of a pixel of the full view.
  int32_t PixelAt(int32_t full_pixel) const;

 private:
  int full_width_, full_height_;
  Viewpoint shrunk_;
};

// Finds the sums of one view after another. The renderer must outlive it.
class WeightSums {
 public:
  explicit WeightSums(Renderer& scene) : scene_(scene) {}

  // Finds, for each Gaussian, the sums of its blend weights over the pixels of each mask. masks:
  // one to three of view.num_pixels() values of 0 or 1.
  void Measure(const WeightView& view, std::span<const std::vector<uint8_t>> masks);
  // Adds the sums of the first `num_masks` masks of the latest view to `sums`,
  // [num_masks, num_gaussians].
  void AddTo(DeviceSpan<float> sums, int num_masks);

 private:
  Renderer& scene_;
  std::vector<float> host_grad_;  // [3, height, width] the masks as gradients of the colours
  Buffer<float> color_grad_;
};

}  // namespace pepeseg
