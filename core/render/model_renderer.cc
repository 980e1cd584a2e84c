#include "core/render/model_renderer.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "core/base/backend_turn.h"
#include "core/base/status_macros.h"
#include "core/render/pinhole_view.h"
#include "kernels/scratch_bytes.h"

namespace pepeseg {
namespace {

constexpr double kNearPlane = 0.01;  // share of the scene radius, as in training
// Opacity logit of a hidden Gaussian. Its opacity of 2e-9 reaches 1 / 255 in no pixel, so that it
// is culled.
constexpr float kHiddenLogit = -20;
constexpr float kMinDepthAlpha = 0.5f;  // accumulated alpha up to which a pixel has no depth

}  // namespace

int64_t MostPixels(int64_t max_view_pixels) {
  return std::max(max_view_pixels, int64_t{1920} * 1080);
}

ModelRenderer::ModelRenderer(Backend& backend, const Model& model)
    : backend_(backend),
      model_(model),
      planes_(backend, std::span<const float>(model.gaussians.planes)),
      features_(backend, std::span<const float>(model.field.features)),
      confidence_(backend, std::span<const float>(model.field.confidence)),
      most_pixels_(MostPixels(LargestView(model.views))) {}

void ModelRenderer::ReleaseOversized() {
  // Buffers never shrink by themselves: one request for a large image would hold its memory for
  // good.
  if (scratch_.pixel_last_entry.capacity() <= WithReserve(most_pixels_)) return;
  for (Buffer<float>* buffer : {&color_, &alpha_, &depth_}) *buffer = {};
  scratch_ = {};
}

// Changes only the opacities, in place, which needs no second copy of the planes.
void ModelRenderer::HideAllBut(const GaussianSet& subset) {
  assert(static_cast<int64_t>(subset.member.size()) == model_.gaussians.count);
  const std::span<const float> logits = model_.gaussians.Plane(kOpacityPlane);
  std::vector<float> shown(logits.size());
  for (size_t i = 0; i < shown.size(); ++i) {
    shown[i] = subset.member[i] != 0 ? logits[i] : kHiddenLogit;
  }
  // The planes lie one after the other, so the opacities are one range.
  planes_.Upload(shown, kOpacityPlane * model_.gaussians.count);
}

void ModelRenderer::ShowAll() {
  planes_.Upload(model_.gaussians.Plane(kOpacityPlane), kOpacityPlane * model_.gaussians.count);
}

// Restores the opacities before a render, not after one, because a backend that ran out of memory
// in a render copies nothing. After an error the opacities are not known and count as hidden.
void ModelRenderer::Show(const GaussianSet* subset) {
  // One set of planes serves all requests of the model, so each render sets the opacities that it
  // needs.
  if (subset != nullptr) {
    HideAllBut(*subset);
  } else if (some_hidden_) {
    ShowAll();
  }
  some_hidden_ = subset != nullptr || !backend_.error().empty();
}

// Renders into color_, alpha_ and depth_, and leaves in scratch_ what features and rows need.
absl::Status ModelRenderer::Render(const ModelView& view, const Pass& pass) {
  const int64_t num_pixels = int64_t{view.camera.width} * view.camera.height;
  color_.Reserve(backend_, 3 * num_pixels);
  if (pass.with_depth) {
    alpha_.Reserve(backend_, num_pixels);
    depth_.Reserve(backend_, num_pixels);
  }
  // An allocation that fails leaves an empty buffer.
  const bool has_depth_room = !pass.with_depth || (!alpha_.empty() && !depth_.empty());
  if (color_.empty() || planes_.empty() || !has_depth_room) {
    return absl::ResourceExhaustedError(absl::StrCat("no memory to render ", view.camera.width, "x",
                                                     view.camera.height, " pixels"));
  }
  Show(pass.subset);
  const Gaussians& gaussians = model_.gaussians;
  backend_.Render(
      {.gaussians = {planes_.span().data, gaussians.count, gaussians.count, gaussians.sh_degree},
       .view = ToPinholeView(view.camera, view.cam_from_world),
       .near_plane = static_cast<float>(kNearPlane * model_.scene_radius),
       .active_sh_degree = pass.sh_degree,
       .scratch = &scratch_,
       .color = color_.span(),
       .alpha = pass.with_depth ? alpha_.span() : DeviceSpan<float>(),
       .depth = pass.with_depth ? depth_.span() : DeviceSpan<float>(),
       .for_backward = false});
  return TakeStatus(backend_);
}

absl::Status ModelRenderer::Features(const ModelView& view, DeviceSpan<Half> map,
                                     const GaussianSet* subset) {
  RETURN_IF_ERROR(Render(view, {.subset = subset}));  // its colours are not used
  backend_.RenderFeatures({features_.span(), &scratch_, map, confidence_.span()});
  return TakeStatus(backend_);
}

absl::StatusOr<PixelRows> ModelRenderer::Rows(const ModelView& view,
                                              std::span<const int32_t> pixels,
                                              const GaussianSet* subset) {
  RETURN_IF_ERROR(Render(view, {.subset = subset}));
  const Buffer<int32_t> pixel_buffer(backend_, pixels);
  Buffer<int32_t> first, gaussian;
  Buffer<float> weight;
  backend_.CaptureRows({.pixels = pixel_buffer.span(),
                        .scratch = &scratch_,
                        .row_first = &first,
                        .entry_gaussian = &gaussian,
                        .entry_weight = &weight});
  PixelRows rows;
  rows.first.resize(first.size());
  rows.gaussian.resize(gaussian.size());
  rows.weight.resize(weight.size());
  first.Download(std::span<int32_t>(rows.first));
  gaussian.Download(std::span<int32_t>(rows.gaussian));
  weight.Download(std::span<float>(rows.weight));
  RETURN_IF_ERROR(TakeStatus(backend_));
  return rows;
}

// The backend's image has a plane for each channel, [3, height, width], in [0, 1] before clamping;
// Image interleaves the channels.
absl::StatusOr<Image> ModelRenderer::Color(const ModelView& view, const GaussianSet* subset) {
  RETURN_IF_ERROR(Render(view, {.sh_degree = model_.gaussians.sh_degree, .subset = subset}));
  std::vector<float> planes(color_.size());
  color_.Download(std::span<float>(planes));
  // After a device error the download is zeros, not the view.
  RETURN_IF_ERROR(TakeStatus(backend_));
  Image image = {view.camera.width, view.camera.height, 3, {}};
  image.pixels.resize(planes.size());
  const size_t num_pixels = planes.size() / 3;
  for (size_t i = 0; i < planes.size(); ++i) {
    const float value = std::clamp(planes[i % 3 * num_pixels + i / 3], 0.0f, 1.0f);
    image.pixels[i] = static_cast<uint8_t>(std::lround(value * 255));
  }
  return image;
}

// The backend blends z with the weights of colour; divided by alpha that is the mean depth.
absl::StatusOr<std::vector<float>> ModelRenderer::Depth(const ModelView& view,
                                                        const GaussianSet* subset) {
  RETURN_IF_ERROR(Render(view, {.subset = subset, .with_depth = true}));
  std::vector<float> alpha(alpha_.size()), depth(depth_.size());
  alpha_.Download(std::span<float>(alpha));
  depth_.Download(std::span<float>(depth));
  RETURN_IF_ERROR(TakeStatus(backend_));
  for (size_t i = 0; i < depth.size(); ++i) {
    depth[i] = alpha[i] > kMinDepthAlpha ? depth[i] / alpha[i] : 0;
  }
  return depth;
}

}  // namespace pepeseg
