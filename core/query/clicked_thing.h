#pragma once

#include <optional>
#include <span>
#include <utility>

#include "absl/status/statusor.h"
#include "core/query/click_follower.h"
#include "core/query/image_segmenter.h"
#include "core/query/prompt.h"
#include "core/query/segmenter.h"
#include "core/query/view_transfer.h"

namespace pepeseg {

// The thing that clicks mean, in all views. For one thread at a time; model and image segmenter
// must outlive it.
//
// In the clicked view it is the mask of a ClickFollower. Where that is a query of the model, so is
// the thing in any other view. Else the pixels of another view that the clicked view shows are
// inside if its mask has them; the others are those of the model's query that fits the mask best.
// An image segmenter then moves this mask to the thing that it sees there.
class ClickedThing {
 public:
  // images: null: the model answers alone. Errors are those of ClickFollower::Follow.
  static absl::StatusOr<ClickedThing> Find(const Segmenter& model, ImageSegmenter* images,
                                           const ModelView& view,
                                           std::span<const PointPrompt> clicks,
                                           const Granularity& granularity,
                                           const WantedCheck& check);

  // Has the segmenter not place the mask in other views.
  void LeaveOtherImages() { images_ = nullptr; }

  // Returns the mask in a view. Errors are those of the segmenter and of Segmenter.
  absl::StatusOr<SegmentResult> In(const ModelView& target, const SegmentOptions& options,
                                   const WantedCheck& check);

 private:
  ClickedThing(const Segmenter& model, ImageSegmenter* images, ModelView view, ClickMeaning meaning)
      : model_(&model), images_(images), view_(std::move(view)), meaning_(std::move(meaning)) {}

  absl::Status Fit();
  absl::StatusOr<SegmentResult> FromModel(const ModelView& target, const SegmentOptions& options);
  absl::Status Transfer(const ModelView& target, SegmentResult& result);

  const Segmenter* model_;
  ImageSegmenter* images_;  // may be null
  ModelView view_;          // clicked
  ClickMeaning meaning_;    // in view_
  // The one of the meaning, or the one that fits its mask; absent until it is needed. No features:
  // the model shows nothing there.
  std::optional<Query> query_;
  std::optional<ViewDepth> depth_;  // of view_; absent until another view is asked for
};

}  // namespace pepeseg
