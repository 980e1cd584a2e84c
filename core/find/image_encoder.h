#pragma once

#include <cstdint>
#include <vector>

#include "absl/status/statusor.h"
#include "core/query/image_segmenter.h"
#include "core/scene/model.h"
#include "kernels/half.h"

namespace pepeseg {

// Features of a network for each place of a view's image, on a coarse grid of cells.
struct ImageFeatures {
  int channels = 0;
  std::vector<Half> values;    // [cells, channels]
  std::vector<int32_t> cells;  // [height * width] the cell of each pixel of a grid over the view
};

// Encodes images of views, such as their photographs. May call `check` at any time and return its
// error.
class ImageEncoder {
 public:
  virtual ~ImageEncoder() = default;
  // Returns the features of a view for a grid of width x height pixels over it.
  virtual absl::StatusOr<ImageFeatures> Encode(const ModelView& view, int width, int height,
                                               const WantedCheck& check) = 0;
};

}  // namespace pepeseg
