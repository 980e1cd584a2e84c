#pragma once

#include <optional>
#include <span>
#include <utility>

#include "absl/status/statusor.h"
#include "core/query/image_segmenter.h"
#include "core/query/prompt.h"
#include "core/query/segmenter.h"
#include "core/query/view_transfer.h"
#include "core/scene/mask_set.h"

namespace pepeseg {

// The thing that clicks mean, by an image segmenter and the model together (METHOD.md section 4,
// "Clicks by SAM"). For one thread at a time; model and image segmenter must outlive it.
//
// In the clicked view it is a mask of the segmenter. For the first positive click that is the mask
// with the largest product of its estimated IoU, the squared IoU with a mask of the model for this
// click, and the root of that one's support. Each further click changes it as the segmenter sees
// it. Of more than 9 clicks, all but the last 8 are answered together.
//
// In another view the pixels that the clicked view shows are inside if its mask has them; the
// others are those of the model's query that fits the mask best. The segmenter then moves this mask
// to the thing that it sees there.
class ClickedThing {
 public:
  // Returns NothingThereError if the segmenter sees nothing at the clicks. Other errors are those
  // of CheckPoints, of the segmenter and of Segmenter.
  static absl::StatusOr<ClickedThing> Find(const Segmenter& model, ImageSegmenter& images,
                                           const ModelView& view,
                                           std::span<const PointPrompt> clicks,
                                           const WantedCheck& check);

  // Returns the mask in a view. Errors are those of the segmenter and of Segmenter.
  absl::StatusOr<SegmentResult> In(const ModelView& target, const SegmentOptions& options,
                                   const WantedCheck& check);

 private:
  ClickedThing(const Segmenter& model, ImageSegmenter& images, ModelView view, BinaryMask mask,
               BorderImage image)
      : model_(&model),
        images_(&images),
        view_(std::move(view)),
        mask_(std::move(mask)),
        image_(image) {}

  absl::Status Fit();
  absl::StatusOr<SegmentResult> FromModel(const ModelView& target, const SegmentOptions& options);

  const Segmenter* model_;
  ImageSegmenter* images_;
  ModelView view_;     // clicked
  BinaryMask mask_;    // in view_
  BorderImage image_;  // in which the clicks were answered
  // Of the mask; absent until the first view is asked for. No features: the model shows nothing
  // there.
  std::optional<Query> query_;
  std::optional<ViewDepth> depth_;  // of view_; absent until another view is asked for
};

}  // namespace pepeseg
