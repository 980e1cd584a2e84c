#pragma once

#include <functional>
#include <span>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/query/prompt.h"
#include "core/query/view_features.h"
#include "core/scene/model.h"
#include "core/scene/soft_mask.h"

namespace pepeseg {

// Returns OK while an answer is wanted; else the error that ends the work, such as CANCELLED. Is
// called before each view.
using WantedCheck = std::function<absl::Status()>;

// Masks that clicks may mean, at least one.
struct ImageMasks {
  std::vector<SoftMask> masks;  // of the size of the view
  BorderImage image = BorderImage::kPhotograph;
};

// Segments the images of views, such as their photographs, by other means than the model. May call
// `check` at any time and return its error.
class ImageSegmenter {
 public:
  virtual ~ImageSegmenter() = default;
  // Returns the masks that clicks in a view may mean. The first click is positive. With a mask
  // `before` the last click (else null), the first answer is that mask, changed as the click asks.
  virtual absl::StatusOr<ImageMasks> Click(const ModelView& view,
                                           std::span<const PointPrompt> clicks,
                                           const SoftMask* before, const WantedCheck& check) = 0;
  // Returns the masks that a box in a view may mean.
  virtual absl::StatusOr<ImageMasks> Box(const ModelView& view, const BoxPrompt& box,
                                         const WantedCheck& check) = 0;
  // How much of a mask Refine may change.
  enum class Change { kBorder, kWhole };
  // Changes the mask of a view, by SetMask, to that of the thing in the image that it shows best,
  // and sets border_image. The result has the similarity. A mask of nothing in the image stays.
  virtual absl::Status Refine(const ModelView& view, Change change, const WantedCheck& check,
                              SegmentResult& result) = 0;
};

}  // namespace pepeseg
