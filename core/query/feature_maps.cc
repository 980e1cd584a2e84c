#include "core/query/feature_maps.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/scene/pinhole_view.h"
#include "core/status_macros.h"

namespace pepeseg {
namespace {

constexpr double kNearPlane = 0.01;  // of the scene radius, as in training

std::string KeyOf(const ModelView& view) {
  const PinholeView v = ToPinholeView(view.camera, view.cam_from_world);
  return {reinterpret_cast<const char*>(&v), sizeof(v)};
}

}  // namespace

FeatureMaps::FeatureMaps(Backend& backend, const Model& model, int64_t max_bytes)
    : backend_(backend),
      model_(model),
      max_bytes_(max_bytes),
      planes_(backend, std::span<const float>(model.gaussians.planes)),
      features_(backend, std::span<const float>(model.field.features)) {}

absl::Status FeatureMaps::Render(const ModelView& view, int sh_degree) {
  const int64_t num_pixels = int64_t{view.camera.width} * view.camera.height;
  color_.Reserve(backend_, 3 * num_pixels);
  if (color_.empty() || planes_.empty()) {
    return absl::ResourceExhaustedError(absl::StrCat("no memory to render ", view.camera.width, "x",
                                                     view.camera.height, " pixels"));
  }
  const Gaussians& gaussians = model_.gaussians;
  backend_.Render(
      {.gaussians = {planes_.span().data, gaussians.count, gaussians.count, gaussians.sh_degree},
       .view = ToPinholeView(view.camera, view.cam_from_world),
       .near_plane = static_cast<float>(kNearPlane * model_.scene_radius),
       .active_sh_degree = sh_degree,
       .scratch = &scratch_,
       .color = color_.span(),
       .alpha = {},
       .depth = {},
       .for_backward = false});
  return absl::OkStatus();
}

absl::StatusOr<DeviceSpan<const Half>> FeatureMaps::Get(const ModelView& view) {
  const std::string key = KeyOf(view);
  const auto found =
      std::find_if(maps_.begin(), maps_.end(), [&](const Map& map) { return map.key == key; });
  if (found != maps_.end()) {
    maps_.splice(maps_.begin(), maps_, found);
    return std::as_const(maps_.front()).pixels.span();
  }
  const int64_t size = int64_t{view.camera.width} * view.camera.height * kFeatureSize;
  const auto num_bytes = size * static_cast<int64_t>(sizeof(Half));
  while (!maps_.empty() && bytes_ + num_bytes > max_bytes_) {
    bytes_ -= maps_.back().pixels.size() * static_cast<int64_t>(sizeof(Half));
    maps_.pop_back();
  }
  Map map = {key, Buffer<Half>(backend_, size)};
  if (map.pixels.empty()) {
    return absl::ResourceExhaustedError(
        absl::StrCat("no memory for a feature map of ", num_bytes, " bytes"));
  }
  RETURN_IF_ERROR(Render(view, 0));  // its colours are not looked at
  backend_.RenderFeatures({features_.span(), &scratch_, map.pixels.span()});
  ++num_renders_;
  bytes_ += num_bytes;
  maps_.push_front(std::move(map));
  return std::as_const(maps_.front()).pixels.span();
}

absl::StatusOr<Image> FeatureMaps::Color(const ModelView& view) {
  RETURN_IF_ERROR(Render(view, model_.gaussians.sh_degree));
  std::vector<float> planes(color_.size());
  color_.Download(std::span<float>(planes));
  // A device that failed leaves zeros: no picture of the scene.
  if (const std::string error = backend_.error(); !error.empty()) {
    return absl::InternalError(error);
  }
  Image image = {view.camera.width, view.camera.height, 3, {}};
  image.pixels.resize(planes.size());
  const size_t num_pixels = planes.size() / 3;
  for (size_t i = 0; i < planes.size(); ++i) {
    const float value = std::clamp(planes[i % 3 * num_pixels + i / 3], 0.0f, 1.0f);
    image.pixels[i] = static_cast<uint8_t>(std::lround(value * 255));
  }
  return image;
}

}  // namespace pepeseg
