#pragma once

#include <atomic>
#include <cstdint>
#include <list>
#include <string>

#include "absl/status/statusor.h"
#include "core/render/model_renderer.h"

namespace pepeseg {

// Bytes that the maps of a model may take together, of the pixels of its largest view: four maps,
// so that a question about some views, or its follow-ups, find theirs again, but no more than
// 512 MiB, four of two megapixels; and always one map of MostPixels.
int64_t MapReserve(int64_t max_view_pixels);

// What models' feature maps were asked for, all of them together; outlives them.
struct MapCounts {
  std::atomic<int64_t> num_hits = 0, num_renders = 0;
};

// Feature maps of a model's views: keeps the last ones asked for, the least recently used go before
// they would be more than `max_bytes` together. Not thread safe, but for the counts.
class FeatureMaps {
 public:
  // `counts`: null, or where to count, too.
  FeatureMaps(ModelRenderer& renderer, int64_t max_bytes, MapCounts* counts = nullptr);

  // The features of each pixel, [height * width, 32]. Valid until the next call. A view is
  // recognised by its camera and pose, whatever its name. RESOURCE_EXHAUSTED: no memory, or, with
  // need and have in the message, a map that is over the limit alone.
  absl::StatusOr<DeviceSpan<const Half>> Get(const ModelView& view);

  int64_t bytes() const { return bytes_; }
  int64_t num_maps() const { return num_maps_; }
  int64_t num_renders() const { return num_renders_; }  // feature maps rendered so far

 private:
  struct Map {
    std::string key;
    Buffer<Half> pixels;
  };

  ModelRenderer& renderer_;
  int64_t max_bytes_;
  MapCounts* counts_;
  std::atomic<int64_t> bytes_ = 0, num_maps_ = 0, num_renders_ = 0;
  std::list<Map> maps_;  // the last used first
};

}  // namespace pepeseg
