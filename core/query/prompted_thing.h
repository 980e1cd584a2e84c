#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <utility>

#include "absl/status/statusor.h"
#include "core/query/image_segmenter.h"
#include "core/query/prompt.h"
#include "core/query/prompt_meaning.h"
#include "core/query/segmenter.h"
#include "core/query/view_transfer.h"

namespace pepeseg {

// The thing that a prompt means, in all views. For one thread at a time; model and image segmenter
// must outlive it.
//
// Points without scale and threshold mean the mask of a ClickFollower, a box that of FindInBox
// where there is an image segmenter, and all other prompts the query of ResolvePrompt. Where the
// meaning is a query of the model, so is the thing in any other view. Where clicks changed a part
// of what a query gives, the pixels of another view that the prompt's view shows are those of the
// query with these changes; where an image segmenter saw the mask, those of the mask. All others
// are those of the model's query that fits the mask best. An image segmenter then moves this mask
// to the thing that it sees there.
class PromptedThing {
 public:
  // images: null: the model answers alone. Errors are those of ClickFollower::Follow, FindInBox and
  // ResolvePrompt.
  static absl::StatusOr<PromptedThing> Find(const Segmenter& model, ImageSegmenter* images,
                                            const Prompt& prompt, const Granularity& granularity,
                                            const WantedCheck& check);

  // Has the segmenter not place the mask in views to come.
  void LeaveOtherImages() { images_ = nullptr; }

  // Returns the mask in a view. Errors are those of the segmenter and of Segmenter.
  absl::StatusOr<SegmentResult> In(const ModelView& target, const SegmentOptions& options,
                                   const WantedCheck& check);

 private:
  PromptedThing(const Segmenter& model, ImageSegmenter* images, ModelView view,
                PromptMeaning meaning)
      : model_(&model), images_(images), view_(std::move(view)), meaning_(std::move(meaning)) {}

  absl::Status Fit();
  absl::StatusOr<SegmentResult> MaskOf(const Query& query, const ModelView& target,
                                       const SegmentOptions& options) const;
  absl::StatusOr<TransferredMap> Transfer(std::span<const uint8_t> map, const ModelView& target);
  // Return the mask in another view where the query of the meaning does not give it: the pixels
  // that the prompt's view shows are as seen there, or as the query gives them, with the changes
  // seen there.
  absl::StatusOr<SegmentResult> SeenIn(const ModelView& target, const SegmentOptions& options);
  absl::StatusOr<SegmentResult> ChangedIn(const ModelView& target, const SegmentOptions& options);

  const Segmenter* model_;
  ImageSegmenter* images_;  // may be null
  ModelView view_;          // of the prompt
  PromptMeaning meaning_;   // in view_
  // The query that fits the mask of the meaning best; absent until it is needed. No features: the
  // model shows nothing there.
  std::optional<Query> query_;
  std::optional<ViewDepth> depth_;  // of view_; absent until another view is asked for
};

}  // namespace pepeseg
