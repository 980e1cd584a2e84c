#include "core/render/feature_maps.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/backend_turn.h"
#include "core/base/status_macros.h"
#include "core/scene/camera.h"

namespace pepeseg {
namespace {

// Returns the bytes of camera and pose. PinholeView has no padding.
std::string KeyOf(const ModelView& view) {
  const PinholeView v = ToPinholeView(view.camera, view.cam_from_world);
  // Exact bytes: views that differ in the last bit of a pose have maps of their own.
  return {reinterpret_cast<const char*>(&v), sizeof(v)};
}

constexpr int64_t MapBytes(int64_t num_pixels) {
  return num_pixels * kFeatureSize * static_cast<int64_t>(sizeof(Half));
}

}  // namespace

double FeatureNorm(const float* feature) {
  double squares = 0;
  for (int k = 0; k < kFeatureSize; ++k) squares += double{feature[k]} * feature[k];
  return std::sqrt(squares);
}

int64_t MapReserve(int64_t max_view_pixels) {
  // Room for four maps of the largest view as long as they take no more than 512 MiB, and at least
  // for one of the largest size that is rendered.
  constexpr int64_t kMostBytes = int64_t{512} << 20;
  return std::max(MapBytes(MostPixels(max_view_pixels)),
                  std::min(4 * MapBytes(max_view_pixels), kMostBytes));
}

FeatureMaps::FeatureMaps(Renderer& renderer, int64_t max_bytes, MapCounts* counts)
    : renderer_(renderer), max_bytes_(max_bytes), counts_(counts) {}

// A hit moves its map to the front. A miss drops maps from the back until the new one fits, before
// it is allocated, so that the maps never exceed max_bytes.
absl::StatusOr<DeviceSpan<const Half>> FeatureMaps::Get(const ModelView& view) {
  const std::string key = KeyOf(view);
  const auto found =
      std::find_if(maps_.begin(), maps_.end(), [&](const Map& map) { return map.key == key; });
  if (found != maps_.end()) {
    maps_.splice(maps_.begin(), maps_, found);
    if (counts_ != nullptr) ++counts_->num_hits;
    return std::as_const(maps_.front()).pixels.span();
  }
  const int64_t num_pixels = int64_t{view.camera.width} * view.camera.height;
  const int64_t num_bytes = MapBytes(num_pixels);
  // Checked before any map is dropped: a view that can never fit must not empty the cache.
  if (num_bytes > max_bytes_) {
    return absl::ResourceExhaustedError(
        absl::StrCat("the feature map of ", view.camera.width, "x", view.camera.height,
                     " pixels needs ", num_bytes, " bytes, but the maps of a model may take ",
                     max_bytes_, "; request a smaller view"));
  }
  while (bytes_ + num_bytes > max_bytes_) {
    bytes_ -= MapBytes(maps_.back().pixels.size() / kFeatureSize);
    maps_.pop_back();
    --num_maps_;
  }
  Map map = {key, Buffer<Half>(renderer_.backend(), num_pixels * kFeatureSize)};
  if (map.pixels.empty()) {
    return absl::ResourceExhaustedError(
        absl::StrCat("no memory for a feature map of ", num_bytes, " bytes"));
  }
  renderer_.Features(view, map.pixels.span());
  RETURN_IF_ERROR(TakeStatus(renderer_.backend()));
  ++num_renders_;
  if (counts_ != nullptr) ++counts_->num_renders;
  ++num_maps_;
  bytes_ += num_bytes;
  maps_.push_front(std::move(map));
  return std::as_const(maps_.front()).pixels.span();
}

}  // namespace pepeseg
