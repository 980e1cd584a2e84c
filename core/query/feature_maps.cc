#include "core/query/feature_maps.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/scene/pinhole_view.h"
#include "core/status_macros.h"

namespace pepeseg {
namespace {

std::string KeyOf(const ModelView& view) {
  const PinholeView v = ToPinholeView(view.camera, view.cam_from_world);
  return {reinterpret_cast<const char*>(&v), sizeof(v)};
}

}  // namespace

FeatureMaps::FeatureMaps(ModelRenderer& renderer, int64_t max_bytes)
    : renderer_(renderer), max_bytes_(max_bytes) {}

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
  if (num_bytes > max_bytes_) {
    return absl::ResourceExhaustedError(
        absl::StrCat("the feature map of ", view.camera.width, "x", view.camera.height,
                     " pixels needs ", num_bytes, " bytes, ", max_bytes_,
                     " are there for the maps of a model: a smaller view takes less"));
  }
  while (bytes_ + num_bytes > max_bytes_) {
    bytes_ -= maps_.back().pixels.size() * static_cast<int64_t>(sizeof(Half));
    maps_.pop_back();
    --num_maps_;
  }
  Map map = {key, Buffer<Half>(renderer_.backend(), size)};
  if (map.pixels.empty()) {
    return absl::ResourceExhaustedError(
        absl::StrCat("no memory for a feature map of ", num_bytes, " bytes"));
  }
  RETURN_IF_ERROR(renderer_.Features(view, map.pixels.span()));
  ++num_renders_;
  ++num_maps_;
  bytes_ += num_bytes;
  maps_.push_front(std::move(map));
  return std::as_const(maps_.front()).pixels.span();
}

}  // namespace pepeseg
