#include "core/render/frozen_scene.h"

#include "core/render/pinhole_view.h"
#include "core/scene/camera.h"

namespace pepeseg {
namespace {

constexpr float kMinDepthAlpha = 0.5f;  // accumulated alpha up to which a pixel has no depth
constexpr double kNearPlane = 0.01;     // share of the scene radius, as in stage one

}  // namespace

FrozenScene::FrozenScene(Backend& backend, const Gaussians& gaussians, double scene_radius)
    : backend_(backend),
      count_(gaussians.count),
      sh_degree_(gaussians.sh_degree),
      near_plane_(static_cast<float>(kNearPlane * scene_radius)),
      planes_(backend, std::span<const float>(gaussians.planes)) {}

// The buffers hold the view that was rendered last; they are reused for the next one.
void FrozenScene::Render(const View& view) {
  const int64_t num_pixels = int64_t{view.camera.width} * view.camera.height;
  color_.Reserve(backend_, 3 * num_pixels);
  alpha_.Reserve(backend_, num_pixels);
  depth_.Reserve(backend_, num_pixels);
  backend_.Render({.gaussians = {planes_.span().data, count_, count_, sh_degree_},
                   .view = ToPinholeView(view.camera, view.cam_from_world),
                   .near_plane = near_plane_,
                   .scratch = &scratch_,
                   .color = color_.span(),
                   .alpha = alpha_.span(),
                   .depth = depth_.span(),
                   // Degree 0 of the harmonics (the default): the colours are not used.
                   .for_backward = false});
}

// The backend blends z with the weights of colour; divided by alpha that is the mean depth.
std::vector<float> FrozenScene::Depth(const View& view) {
  Render(view);
  std::vector<float> alpha(alpha_.size()), depth(depth_.size());
  alpha_.Download(std::span<float>(alpha));
  depth_.Download(std::span<float>(depth));
  for (size_t i = 0; i < depth.size(); ++i) {
    // z in the camera's frame, scene units; 0: unknown.
    depth[i] = alpha[i] > kMinDepthAlpha ? depth[i] / alpha[i] : 0.0f;
  }
  return depth;
}

// Rasterises the whole view, then lists for each pixel the Gaussians and weights that it blended.
CapturedRows FrozenScene::Capture(const View& view, std::span<const int32_t> pixels) {
  Render(view);
  CapturedRows rows;
  const Buffer<int32_t> pixel_buffer(backend_, pixels);
  rows.alpha = Buffer<float>(backend_, static_cast<int64_t>(pixels.size()));
  backend_.CaptureRows({.pixels = pixel_buffer.span(),
                        .scratch = &scratch_,
                        .row_first = &rows.first,
                        .entry_gaussian = &rows.gaussian,
                        .entry_weight = &rows.weight,
                        .pixel_alpha = rows.alpha.span(),
                        .pixel_depth = {}});
  backend_.Sync();  // pixel_buffer is freed on return
  return rows;
}

HostRows::HostRows(const CapturedRows& rows)
    : first(static_cast<size_t>(rows.first.size())),
      gaussian(static_cast<size_t>(rows.gaussian.size())),
      weight(static_cast<size_t>(rows.weight.size())) {
  rows.first.Download(std::span<int32_t>(first));
  rows.gaussian.Download(std::span<int32_t>(gaussian));
  rows.weight.Download(std::span<float>(weight));
}

std::vector<int32_t> KnownGridPixels(const View& view, double max_cells) {
  std::vector<int32_t> pixels = GridPixels(view.camera, max_cells);
  if (!view.ignore.empty()) std::erase_if(pixels, [&](int32_t p) { return view.ignore[p] != 0; });
  return pixels;
}

}  // namespace pepeseg
