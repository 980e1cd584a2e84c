#include "core/query/prompted_thing.h"

#include <cstddef>
#include <utility>
#include <variant>
#include <vector>

#include "core/base/status_macros.h"
#include "core/query/box_meaning.h"
#include "core/query/click_follower.h"
#include "core/query/mask_geometry.h"
#include "core/query/resolve_prompt.h"

namespace pepeseg {

namespace {

absl::StatusOr<PromptMeaning> FindMeaning(const Segmenter& model, ImageSegmenter* images,
                                          const Prompt& prompt, const Granularity& granularity,
                                          const WantedCheck& check) {
  const auto* const clicks = std::get_if<PointsPrompt>(&prompt.what);
  const auto* const box = std::get_if<BoxPrompt>(&prompt.what);
  const bool is_given = granularity.scale && granularity.threshold;
  if (clicks != nullptr && !is_given) {
    RETURN_IF_ERROR(CheckGranularity(granularity));
    ClickFollower follower(model, images, prompt.view, granularity);
    RETURN_IF_ERROR(follower.Follow(*clicks, prompt.previous, check));
    return follower.meaning();
  }
  if (box != nullptr && images != nullptr) {
    return FindInBox(model, *images, prompt.view, *box, check);
  }
  PromptMeaning meaning;
  ASSIGN_OR_RETURN(meaning.query, ResolvePrompt(model, prompt, granularity));
  meaning.is_of_query = true;
  return meaning;
}

}  // namespace

absl::StatusOr<PromptedThing> PromptedThing::Find(const Segmenter& model, ImageSegmenter* images,
                                                  const Prompt& prompt,
                                                  const Granularity& granularity,
                                                  const WantedCheck& check) {
  ASSIGN_OR_RETURN(PromptMeaning meaning, FindMeaning(model, images, prompt, granularity, check));
  return PromptedThing(model, images, prompt.view, std::move(meaning));
}

// Finds the query that decides pixels which the prompt's view does not show, and scores a mask that
// the model did not find.
absl::Status PromptedThing::Fit() {
  if (query_) return absl::OkStatus();
  auto query = CheckNotEmpty(meaning_.mask).ok() ? FitMask(*model_, view_, meaning_.mask, {})
                                                 : NothingThereError("the prompt leaves nothing");
  if (query.ok()) {
    query_ = *std::move(query);
  } else if (IsNothingThere(query.status())) {
    query_.emplace();
  } else {
    return query.status();
  }
  return absl::OkStatus();
}

absl::StatusOr<SegmentResult> PromptedThing::MaskOf(const Query& query, const ModelView& target,
                                                    const SegmentOptions& options) const {
  if (!query.features.empty()) {
    ASSIGN_OR_RETURN(auto results, model_->Segment(query, {&target, 1}, options));
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

// Sets the pixels of another view that the prompt's view shows.
absl::Status PromptedThing::Transfer(const ModelView& target, SegmentResult& result) {
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

absl::StatusOr<SegmentResult> PromptedThing::In(const ModelView& target,
                                                const SegmentOptions& options,
                                                const WantedCheck& check) {
  if (meaning_.is_of_query) return MaskOf(meaning_.query, target, options);
  SegmentOptions with_similarity = options;
  with_similarity.want_similarity = true;  // SetMask needs it
  const bool is_own = target.name == view_.name, is_known = !meaning_.query.features.empty();
  if (!is_own || !is_known) RETURN_IF_ERROR(Fit());
  ASSIGN_OR_RETURN(SegmentResult result,
                   MaskOf(is_own && is_known ? meaning_.query : *query_, target, with_similarity));
  if (is_own) {
    SetMask(meaning_.mask, result);
    result.border_image = meaning_.image;
  } else {
    RETURN_IF_ERROR(Transfer(target, result));
    if (images_ != nullptr) {
      RETURN_IF_ERROR(images_->Refine(target, ImageSegmenter::Change::kWhole, check, result));
    }
  }
  if (!options.want_similarity) result.similarity.clear();
  return result;
}

}  // namespace pepeseg
