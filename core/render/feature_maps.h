#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <list>
#include <span>
#include <string>

#include "absl/status/statusor.h"
#include "core/render/renderer.h"
#include "core/scene/camera.h"
#include "core/scene/capture.h"
#include "core/scene/model.h"
#include "kernels/buffer.h"
#include "kernels/ops/render.h"

namespace pepeseg {

// Smallest length of a blended feature of a pixel that may be in a mask. Shorter ones are of faint
// Gaussians in front of the empty background. Inside an object the length is near 1, at the border
// of two objects about 0.7.
inline constexpr float kMinPixelNorm = 0.4f;

// Returns the length of a feature, [32].
double FeatureNorm(const float* feature);

// Returns the memory for a model's feature maps, bytes, from the number of pixels of its largest
// view: four maps of that view, so that follow-up queries find theirs again, but at most 608 MiB
// (four maps of two megapixels) and at least one map of MostPixels.
int64_t MapReserve(int64_t max_view_pixels);

// Totals over the feature maps of all models, which it outlives.
struct MapCounts {
  std::atomic<int64_t> num_hits = 0, num_renders = 0;
};

// Returns the bytes of camera and pose, by which a view is recognised: not by its name.
std::string ViewKey(const ModelView& view);

// The rendered features and colours of a view, in backend memory.
struct FeatureMap {
  DeviceSpan<const Half> features;  // [height * width, 32] blended
  DeviceSpan<const float> color;    // [3, height, width] in [0, 1] before clamping
};

// Cache of the feature maps of a model's views, at most `max_bytes` together: the least recently
// used maps are dropped first. Not thread-safe, except for the counts.
class FeatureMaps {
 public:
  // counts: totals to increment as well, or null. The renderer must outlive the cache.
  FeatureMaps(Renderer& renderer, int64_t max_bytes, MapCounts* counts = nullptr);

  // Returns the map of a view, valid until the next call. Views are recognised by their ViewKey.
  // Returns RESOURCE_EXHAUSTED when out of memory or when the map alone exceeds max_bytes, which
  // drops no other map.
  absl::StatusOr<FeatureMap> Get(const ModelView& view);

  int64_t bytes() const { return bytes_; }
  int64_t num_maps() const { return num_maps_; }
  int64_t num_renders() const { return num_renders_; }  // maps rendered since the start

 private:
  struct Map {
    std::string key;
    Buffer<Half> features;
    Buffer<float> color;

    FeatureMap View() const { return {features.span(), color.span()}; }
  };

  Renderer& renderer_;
  int64_t max_bytes_;
  MapCounts* counts_;
  std::atomic<int64_t> bytes_ = 0, num_maps_ = 0, num_renders_ = 0;
  std::list<Map> maps_;  // the most recently used first
};

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
