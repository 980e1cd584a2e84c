#include "core/query/clicked_thing.h"

#include <cstddef>
#include <utility>
#include <vector>

#include "core/base/status_macros.h"
#include "core/query/mask_geometry.h"
#include "core/query/resolve_prompt.h"

namespace pepeseg {

absl::StatusOr<ClickedThing> ClickedThing::Find(const Segmenter& model, ImageSegmenter* images,
                                                const ModelView& view,
                                                std::span<const PointPrompt> clicks,
                                                const Granularity& granularity,
                                                const WantedCheck& check) {
  ClickFollower follower(model, images, view, granularity);
  RETURN_IF_ERROR(follower.Follow(clicks, check));
  return ClickedThing(model, images, view, follower.meaning());
}

// Finds the query that scores the mask, and decides pixels which the clicked view does not show.
absl::Status ClickedThing::Fit() {
  if (query_) return absl::OkStatus();
  if (meaning_.query) {
    query_ = meaning_.query;
    return absl::OkStatus();
  }
  auto query = CheckNotEmpty(meaning_.mask).ok() ? FitMask(*model_, view_, meaning_.mask, {})
                                                 : NothingThereError("the clicks leave nothing");
  if (query.ok()) {
    query_ = *std::move(query);
  } else if (IsNothingThere(query.status())) {
    query_.emplace();
  } else {
    return query.status();
  }
  return absl::OkStatus();
}

absl::StatusOr<SegmentResult> ClickedThing::FromModel(const ModelView& target,
                                                      const SegmentOptions& options) {
  RETURN_IF_ERROR(Fit());
  SegmentOptions with_similarity = options;
  with_similarity.want_similarity |= !meaning_.query;  // SetMask needs it
  if (!query_->features.empty()) {
    ASSIGN_OR_RETURN(auto results, model_->Segment(*query_, {&target, 1}, with_similarity));
    return std::move(results.front());
  }
  SegmentResult nothing;
  nothing.view = target.name;
  nothing.width = target.camera.width;
  nothing.height = target.camera.height;
  const size_t num_pixels = static_cast<size_t>(nothing.width) * nothing.height;
  nothing.mask.pixels.resize(num_pixels);
  nothing.similarity.resize(num_pixels);
  return nothing;
}

// Sets the pixels of another view that the clicked view shows.
absl::Status ClickedThing::Transfer(const ModelView& target, SegmentResult& result) {
  if (!depth_) {
    ASSIGN_OR_RETURN(std::vector<float> depth, model_->RenderDepth(view_));
    depth_ = {view_, std::move(depth)};
  }
  ViewDepth there = {target, {}};
  ASSIGN_OR_RETURN(there.depth, model_->RenderDepth(target));
  const TransferredMask seen = TransferMask(*depth_, meaning_.mask.pixels, there);
  BinaryMask mask = result.mask;
  for (size_t i = 0; i < mask.pixels.size(); ++i) {
    if (seen.known[i] != 0) mask.pixels[i] = seen.inside[i];
  }
  SetMask(std::move(mask), result);
  return absl::OkStatus();
}

absl::StatusOr<SegmentResult> ClickedThing::In(const ModelView& target,
                                               const SegmentOptions& options,
                                               const WantedCheck& check) {
  ASSIGN_OR_RETURN(SegmentResult result, FromModel(target, options));
  if (!meaning_.query && target.name == view_.name) {
    SetMask(meaning_.mask, result);
    result.border_image = meaning_.image;
  } else if (!meaning_.query) {
    RETURN_IF_ERROR(Transfer(target, result));
    if (images_ != nullptr) {
      RETURN_IF_ERROR(images_->Refine(target, ImageSegmenter::Change::kWhole, check, result));
    }
  }
  if (!options.want_similarity) result.similarity.clear();
  return result;
}

}  // namespace pepeseg
