#include "tests/bench/granularity.h"

#include <algorithm>
#include <cmath>

#include "core/base/status_macros.h"
#include "core/cluster/hdbscan.h"
#include "core/render/renderer.h"
#include "core/scene/model.h"

namespace pepeseg {
namespace {

constexpr double kMaxPoints = 16'384;
constexpr float kMinNorm =
    0.5f;  // minimum norm of a pixel's feature; below it, little is rendered there

std::vector<int32_t> Grid(const Camera& camera, int stride) {
  std::vector<int32_t> pixels;
  for (int y = stride / 2; y < camera.height; y += stride) {
    for (int x = stride / 2; x < camera.width; x += stride) pixels.push_back(y * camera.width + x);
  }
  return pixels;
}

// Returns the features [n, 32] of the pixels on which something is rendered.
std::vector<float> Features(Backend& backend, Renderer& scene, const View& view,
                            std::span<const int32_t> pixels, const Buffer<float>& features) {
  const CapturedRows rows = scene.Rows(view, pixels);
  Buffer<float> of_pixels(backend, static_cast<int64_t>(pixels.size()) * kFeatureSize);
  backend.FeatureRows({{rows.first.span(), rows.gaussian.span(), rows.weight.span()},
                       features.span(),
                       of_pixels.span()});
  std::vector<float> all(static_cast<size_t>(of_pixels.size())), kept;
  of_pixels.Download(std::span<float>(all));
  for (size_t i = 0; i < all.size(); i += kFeatureSize) {
    float squares = 0;
    for (int k = 0; k < kFeatureSize; ++k) squares += all[i + k] * all[i + k];
    if (squares < kMinNorm * kMinNorm) continue;
    kept.insert(kept.end(), all.begin() + static_cast<std::ptrdiff_t>(i),
                all.begin() + static_cast<std::ptrdiff_t>(i + kFeatureSize));
  }
  return kept;
}

absl::Status Add(Backend& backend, const Model& model, const std::vector<float>& features,
                 double pixels_per_point, ClusterSizes& sum) {
  const std::vector<float> units =
      GatedUnits(features, model.field.gate, static_cast<float>(sum.scale));
  ASSIGN_OR_RETURN(const Clusters clusters,
                   Hdbscan(backend, std::span<const float>(units), HdbscanOptions{20, 5}));
  const auto num_noise = static_cast<double>(std::ranges::count(clusters.labels, -1));
  const auto num_points = static_cast<double>(clusters.labels.size());
  sum.num_clusters += clusters.count;
  if (clusters.count > 0) {
    sum.mean_pixels += pixels_per_point * (num_points - num_noise) / clusters.count;
  }
  if (num_points > 0) sum.noise_share += num_noise / num_points;
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<std::vector<ClusterSizes>> MeasureGranularity(Backend& backend,
                                                             const Capture& capture,
                                                             const Model& model,
                                                             const std::vector<double>& scales) {
  std::vector<ClusterSizes> measured;
  measured.reserve(scales.size());
  for (const double scale : scales) measured.push_back({.scale = scale});
  Renderer scene(backend, model.gaussians, model.scene_radius);
  const Buffer<float> features(backend, std::span<const float>(model.field.features));
  int num_views = 0;
  for (const View& view : capture.views) {
    if (!view.held_out) continue;
    ++num_views;
    const Camera& camera = view.camera;
    const int stride = std::max(1, static_cast<int>(std::ceil(std::sqrt(
                                       double{1} * camera.width * camera.height / kMaxPoints))));
    const std::vector<float> of_view =
        Features(backend, scene, view, Grid(camera, stride), features);
    for (ClusterSizes& sum : measured) {
      RETURN_IF_ERROR(Add(backend, model, of_view, double{1} * stride * stride, sum));
    }
  }
  for (ClusterSizes& sum : measured) {
    sum.num_clusters /= num_views;
    sum.mean_pixels /= num_views;
    sum.noise_share /= num_views;
  }
  return measured;
}

}  // namespace pepeseg
